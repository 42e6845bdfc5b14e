//! Plain data, as in scripting languages.

use crate::Array;

/// Plain data of a pickle or of an array of objects.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// `None`, and anything that is not a number, text, bytes or a collection.
    Nothing,
    /// A number or truth value.
    Number(f64),
    /// Text.
    Text(String),
    /// Bytes, and Python 2's strings that are not plain text.
    Bytes(Vec<u8>),
    /// List, tuple or set.
    List(Vec<Value>),
    /// Keys and values.
    Dict(Vec<(Value, Value)>),
    /// A numpy array or a torch tensor of numbers.
    Array(Array),
    /// An object of a library whose objects are read as data: the full name of its class, and its fields (usually a
    /// dictionary).
    Object {
        /// E.g. `scipy.sparse.csc.csc_matrix`.
        class: String,
        /// The object's fields.
        fields: Box<Value>,
    },
}

impl Value {
    /// The value of a text key in a dictionary or in an object's fields.
    pub fn get(&self, key: &str) -> Option<&Value> {
        if let Self::Object { fields, .. } = self {
            return fields.get(key);
        }
        self.entries()?
            .iter()
            // The last value of a repeated key counts, as in Python.
            .rev()
            .find(|(k, _)| k.text() == Some(key))
            .map(|(_, value)| value)
    }

    /// Keys and values of a dictionary.
    pub fn entries(&self) -> Option<&[(Value, Value)]> {
        match self {
            Self::Dict(entries) => Some(entries),
            _ => None,
        }
    }

    /// The items of a list.
    pub fn items(&self) -> Option<&[Value]> {
        match self {
            Self::List(items) => Some(items),
            _ => None,
        }
    }

    /// A text.
    pub fn text(&self) -> Option<&str> {
        match self {
            Self::Text(text) => Some(text),
            _ => None,
        }
    }

    /// Description of the value's type, for errors.
    pub fn kind(&self) -> String {
        match self {
            Self::Nothing => "nothing".into(),
            Self::Number(_) => "a number".into(),
            Self::Text(_) => "text".into(),
            Self::Bytes(bytes) => format!("{} bytes", bytes.len()),
            Self::List(items) => format!("a list of {}", items.len()),
            Self::Dict(entries) => format!("a dictionary of {}", entries.len()),
            Self::Array(array) => format!("an array of shape {:?}", array.shape),
            Self::Object { class, .. } => format!("a {class}"),
        }
    }

    /// An array, a number, nested lists of equal lengths, or a chumpy variable, as an array.
    pub fn numbers(&self) -> Option<Array> {
        match self {
            Self::Number(number) => Some(Array {
                shape: Vec::new(),
                values: vec![*number],
            }),
            Self::Array(array) => Some(array.clone()),
            Self::List(items) => {
                let mut inner: Option<Vec<usize>> = None;
                let mut values = Vec::new();
                for item in items {
                    let array = item.numbers()?;
                    if inner.as_ref().is_some_and(|inner| *inner != array.shape) {
                        return None;
                    }
                    inner = Some(array.shape);
                    values.extend(array.values);
                }
                let mut shape = vec![items.len()];
                shape.extend(inner.unwrap_or_default());
                Some(Array { shape, values })
            }
            Self::Object { class, fields } if class.starts_with("chumpy.") => {
                fields.get("x")?.numbers()
            }
            _ => None,
        }
    }
}
