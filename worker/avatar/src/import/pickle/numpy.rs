//! How numpy writes its arrays into pickles: a few calls, read here as descriptions.

use super::machine::{Id, Machine, Node};
use super::{PickleError, Value};

/// Element type of an array, e.g. `f4`.
#[derive(Clone, Debug, Default)]
pub(super) struct Kind {
    code: String,
    big_endian: bool,
}

/// An array as it was written.
#[derive(Clone, Debug, Default)]
pub(super) struct Array {
    shape: Vec<usize>,
    kind: Kind,
    columns_first: bool,
    bytes: Vec<u8>,
}

impl Array {
    /// Its numbers, rows first.
    pub fn value(&self) -> Result<Value, PickleError> {
        let mut values = self.kind.numbers(&self.bytes)?;
        let expected = self
            .shape
            .iter()
            .try_fold(1usize, |product, side| product.checked_mul(*side));
        if expected != Some(values.len()) {
            return Err(PickleError::Malformed(
                "an array whose size is not its shape's",
            ));
        }
        if let (true, [rows, columns]) = (self.columns_first, &self.shape[..]) {
            let original = values.clone();
            for (at, value) in values.iter_mut().enumerate() {
                let (row, column) = (at / columns, at % columns);
                *value = original
                    .get(column * rows + row)
                    .copied()
                    .unwrap_or(f64::NAN);
            }
        } else if self.columns_first && self.shape.len() > 2 {
            return Err(PickleError::Malformed(
                "an array of more than two axes, columns first",
            ));
        }
        Ok(Value::Array {
            shape: self.shape.clone(),
            values,
        })
    }
}

impl Kind {
    fn numbers(&self, bytes: &[u8]) -> Result<Vec<f64>, PickleError> {
        let each = |size: usize, convert: &dyn Fn(u64) -> f64| -> Vec<f64> {
            bytes
                .chunks_exact(size)
                .map(|chunk| {
                    let join = |bits: u64, byte: &u8| bits << 8 | u64::from(*byte);
                    convert(if self.big_endian {
                        chunk.iter().fold(0, join)
                    } else {
                        chunk.iter().rev().fold(0, join)
                    })
                })
                .collect()
        };
        Ok(match self.code.trim_start_matches(['<', '>', '=', '|']) {
            "f8" => each(8, &f64::from_bits),
            "f4" => each(4, &|bits| f64::from(f32::from_bits(bits as u32))),
            "i8" => each(8, &|bits| bits as i64 as f64),
            "i4" => each(4, &|bits| f64::from(bits as u32 as i32)),
            _ => {
                return Err(PickleError::Malformed(
                    "an array of neither f4, f8, i4 nor i8",
                ));
            }
        })
    }
}

/// What `function(arguments)` stands for.
pub(super) fn call(machine: &Machine, function: Id, arguments: Id) -> Result<Node, PickleError> {
    let Node::Global(name) = machine.node(function)? else {
        return Err(PickleError::Malformed("a call of what is no function"));
    };
    let Node::List(arguments) = machine.node(arguments)? else {
        return Err(PickleError::Malformed("a call without arguments"));
    };
    let argument = |at: usize| {
        let id = arguments.get(at).copied();
        machine.node(id.ok_or(PickleError::Malformed("a call with too few arguments"))?)
    };
    // numpy 2 moved its modules to numpy._core.
    match name.replace("numpy._core.", "numpy.core.").as_str() {
        "numpy.dtype" => Ok(Node::Kind(Kind {
            code: text(argument(0)?)?,
            big_endian: false,
        })),
        "numpy.core.multiarray._reconstruct" => Ok(Node::Array(Array::default())),
        "numpy.core.numeric._frombuffer" => Ok(Node::Array(Array {
            bytes: bytes(argument(0)?)?,
            kind: kind(argument(1)?)?,
            shape: shape(machine, argument(2)?)?,
            columns_first: text(argument(3)?)? == "F",
        })),
        "numpy.core.multiarray.scalar" => {
            let numbers = kind(argument(0)?)?.numbers(&bytes(argument(1)?)?)?;
            match numbers[..] {
                [number] => Ok(Node::Number(number)),
                _ => Err(PickleError::Malformed("a scalar that is not one number")),
            }
        }
        // How Python 3 writes bytes for Python 2: each as the character of its number.
        "_codecs.encode" => {
            let text = text(argument(0)?)?;
            let bytes: Result<Vec<u8>, _> = text.chars().map(|c| u8::try_from(c as u32)).collect();
            Ok(Node::Bytes(bytes.map_err(|_| {
                PickleError::Malformed("bytes of characters over 255")
            })?))
        }
        "collections.OrderedDict" => Ok(Node::Dict(Vec::new())),
        _ => Err(PickleError::Call(name.clone())),
    }
}

/// What `target` is once it was given its `state`.
pub(super) fn build(machine: &Machine, target: Id, state: Id) -> Result<Node, PickleError> {
    let Node::List(state) = machine.node(state)? else {
        return Err(PickleError::Malformed("a state that is no tuple"));
    };
    let part = |at: usize| {
        let id = state.get(at).copied();
        machine.node(id.ok_or(PickleError::Malformed("a state with too few parts"))?)
    };
    match machine.node(target)? {
        // (version, byte order, …)
        Node::Kind(kind) => Ok(Node::Kind(Kind {
            code: kind.code.clone(),
            big_endian: text(part(1)?)? == ">",
        })),
        // (version, shape, dtype, columns first, bytes)
        Node::Array(_) => Ok(Node::Array(Array {
            shape: shape(machine, part(1)?)?,
            kind: kind(part(2)?)?,
            columns_first: matches!(part(3)?, Node::Number(flag) if *flag != 0.0),
            bytes: bytes(part(4)?)?,
        })),
        _ => Err(PickleError::Malformed("a state for what has none")),
    }
}

fn text(node: &Node) -> Result<String, PickleError> {
    match node {
        Node::Text(text) => Ok(text.clone()),
        _ => Err(PickleError::Malformed("something else where text belongs")),
    }
}

fn bytes(node: &Node) -> Result<Vec<u8>, PickleError> {
    match node {
        Node::Bytes(bytes) => Ok(bytes.clone()),
        // Bytes of Python 2 that happen to be readable.
        Node::Text(text) => Ok(text.clone().into_bytes()),
        _ => Err(PickleError::Malformed("something else where bytes belong")),
    }
}

fn kind(node: &Node) -> Result<Kind, PickleError> {
    match node {
        Node::Kind(kind) => Ok(kind.clone()),
        _ => Err(PickleError::Malformed(
            "something else where a dtype belongs",
        )),
    }
}

fn shape(machine: &Machine, node: &Node) -> Result<Vec<usize>, PickleError> {
    let Node::List(sides) = node else {
        return Err(PickleError::Malformed("a shape that is no tuple"));
    };
    sides
        .iter()
        .map(|side| match machine.node(*side)? {
            Node::Number(side) if *side >= 0.0 && *side < 1e9 => Ok(*side as usize),
            _ => Err(PickleError::Malformed("a side that is no length")),
        })
        .collect()
}
