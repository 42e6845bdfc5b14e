//! Objects of numpy, scipy, chumpy and torch. Pickles build them with a few calls, which are read here as data.

use super::machine::{Id, Machine, Node};
use super::storage::{self, StorageBytes};
use super::{MAX_NAME, PickleError, joblib};
use crate::array::{count, rows_first};
use crate::dtype::Dtype;
use crate::{Array, Value};
use std::rc::Rc;

/// Libraries with objects that are kept as a class name with fields.
const DATA_CLASSES: [&str; 2] = ["scipy.sparse.", "chumpy."];
/// Largest set. Sets are copied, and captures use lists, dictionaries and arrays instead.
const MAX_SET: usize = 1 << 10;

/// Longest path, bytes and parts.
const MAX_PATH: usize = 4096;

/// An array as stored.
#[derive(Clone, Debug, Default)]
pub(super) struct RawArray {
    pub shape: Vec<usize>,
    pub dtype: Dtype,
    pub columns_first: bool,
    pub data: StorageBytes,
}

impl RawArray {
    /// Number of elements that fit in its bytes, for limits.
    pub(super) fn len(&self) -> usize {
        self.data.len() / self.dtype.size().unwrap_or(1).max(1)
    }

    /// Whether its elements are strings.
    pub(super) fn is_text(&self) -> bool {
        self.dtype.is_text()
    }

    /// Its numbers or texts; `bytes` is the whole file.
    pub(super) fn value(&self, bytes: &[u8]) -> Result<Value, PickleError> {
        let bytes = self.data.bytes(bytes);
        let fits = |found: usize| {
            if count(&self.shape) == Some(found) {
                Ok(())
            } else {
                Err(PickleError::Malformed(
                    "an array whose size differs from its shape",
                ))
            }
        };
        if let Some(texts) = self.dtype.texts(bytes) {
            fits(texts.len())?;
            return Ok(Value::List(texts));
        }
        let values = self.dtype.numbers(bytes);
        let values = values.ok_or(PickleError::Malformed(
            "an array of neither integers, floats nor strings",
        ))?;
        fits(values.len())?;
        let values = if self.columns_first {
            rows_first(&self.shape, values)
        } else {
            values
        };
        Ok(Value::Array(Array {
            shape: self.shape.clone(),
            values,
        }))
    }
}

/// The value of `function(arguments)`, for the few functions that describe data. Nothing is called: a name that is
/// not listed here is an error.
pub(super) fn call(machine: &Machine, function: Id, arguments: Id) -> Result<Node, PickleError> {
    let Node::Global(name) = machine.node(function)? else {
        return Err(PickleError::Malformed(
            "a call of a value that is not a function",
        ));
    };
    let Node::List(arguments) = machine.node(arguments)? else {
        return Err(PickleError::Malformed("a call without arguments"));
    };
    let argument = |at: usize| {
        let id = arguments.get(at).copied();
        machine.node(id.ok_or(PickleError::Malformed("a call with too few arguments"))?)
    };
    // numpy 2 moved its modules to numpy._core, and Python 2's own modules have other names.
    let known = name
        .replace("numpy._core.", "numpy.core.")
        .replace("__builtin__.", "builtins.")
        .replace("copy_reg.", "copyreg.");
    match known.as_str() {
        "numpy.dtype" => {
            let code = text(argument(0)?)?;
            if code.len() > MAX_NAME {
                return Err(PickleError::Malformed("a dtype with too long a name"));
            }
            Ok(Node::Dtype(Dtype::new(&code)))
        }
        "numpy.core.multiarray._reconstruct" => Ok(Node::Array(RawArray::default())),
        "numpy.core.numeric._frombuffer" => Ok(Node::Array(RawArray {
            data: bytes(argument(0)?)?.into(),
            dtype: dtype(argument(1)?)?,
            shape: shape(machine, argument(2)?)?,
            columns_first: &*text(argument(3)?)? == "F",
        })),
        "numpy.core.multiarray.scalar" => {
            let (dtype, bytes) = (dtype(argument(0)?)?, bytes(argument(1)?)?);
            machine.spend(bytes.len())?;
            if let Some([Value::Text(text)]) = dtype.texts(&bytes).as_deref() {
                return Ok(Node::Text(text.as_str().into()));
            }
            match dtype.numbers(&bytes).as_deref() {
                Some([number]) => Ok(Node::Number(*number)),
                _ => Err(PickleError::Malformed(
                    "a scalar that is not one number or text",
                )),
            }
        }
        // Python 3 writes bytes for Python 2 as the characters with the same numbers.
        "_codecs.encode" => {
            let text = text(argument(0)?)?;
            machine.spend(text.len())?;
            let bytes: Result<Vec<u8>, _> = text.chars().map(|c| u8::try_from(c as u32)).collect();
            let bytes =
                bytes.map_err(|_| PickleError::Malformed("bytes of characters over 255"))?;
            Ok(Node::Bytes(bytes.into()))
        }
        "builtins.bytes" if arguments.is_empty() => Ok(Node::Bytes(Rc::default())),
        // A defaultdict's argument is its factory, which is a function and not data.
        "collections.OrderedDict" | "collections.defaultdict" => Ok(Node::Dict(Vec::new())),
        "builtins.set" | "builtins.frozenset" | "builtins.list" | "builtins.tuple"
        | "torch.Size" => {
            if arguments.is_empty() {
                return Ok(Node::List(Vec::new()));
            }
            match argument(0)? {
                Node::List(items) if items.len() <= MAX_SET => {
                    machine.spend(size_of::<Id>() * items.len())?;
                    Ok(Node::List(items.clone()))
                }
                Node::List(_) => Err(PickleError::TooLarge),
                _ => Err(PickleError::Malformed(
                    "a set of a value that is not a list",
                )),
            }
        }
        "copyreg._reconstructor" | "copyreg.__newobj__" => match argument(0)? {
            Node::Global(class) => object(class),
            _ => Err(PickleError::Malformed(
                "an object of a value that is not a class",
            )),
        },
        "torch._utils._rebuild_tensor_v2" | "torch._utils._rebuild_tensor" => {
            let whole = |at| storage::lengths(machine, argument(at)?);
            let offset = match argument(1)? {
                Node::Number(offset) => storage::length(*offset)?,
                _ => return Err(PickleError::Malformed("a tensor without an offset")),
            };
            storage::tensor(argument(0)?, offset, whole(2)?, whole(3)?)
        }
        "torch._utils._rebuild_parameter" => match argument(0)? {
            Node::Tensor(tensor) => Ok(Node::Tensor(tensor.clone())),
            _ => Err(PickleError::Malformed("a parameter that is not a tensor")),
        },
        "torch.storage._load_from_bytes" => {
            storage::load_from_bytes(machine, &bytes(argument(0)?)?)
        }
        "torch.serialization._get_layout" | "torch.device" => Ok(Node::Nothing),
        "pathlib.PosixPath"
        | "pathlib.WindowsPath"
        | "pathlib.PurePosixPath"
        | "pathlib.PureWindowsPath"
        | "pathlib._local.PosixPath"
        | "pathlib._local.WindowsPath" => path(machine, arguments),
        _ => object(name),
    }
}

/// The text of a path from its parts; the first may be the root.
fn path(machine: &Machine, parts: &[Id]) -> Result<Node, PickleError> {
    const LONG: PickleError = PickleError::Malformed("too long a path");
    if parts.len() > MAX_PATH {
        return Err(LONG);
    }
    let mut path = String::new();
    for part in parts {
        if !path.is_empty() && !path.ends_with(['/', '\\']) {
            path.push('/');
        }
        path.push_str(&text(machine.node(*part)?)?);
        if path.len() > MAX_PATH {
            return Err(LONG);
        }
    }
    machine.spend(path.len())?;
    Ok(Node::Text(path.into()))
}

/// An object of a class that is read as data.
fn object(class: &Rc<str>) -> Result<Node, PickleError> {
    if DATA_CLASSES.iter().any(|known| class.starts_with(known)) || **class == *joblib::WRAPPER {
        Ok(Node::Object(class.clone(), None))
    } else {
        Err(PickleError::Call(class.to_string()))
    }
}

/// `target` after it receives its `state`.
pub(super) fn build(machine: &Machine, target: Id, state: Id) -> Result<Node, PickleError> {
    if let Node::Object(class, _) = machine.node(target)? {
        return Ok(Node::Object(class.clone(), Some(state)));
    }
    let Node::List(state) = machine.node(state)? else {
        return Err(PickleError::Malformed("a state that is not a tuple"));
    };
    let part = |at: usize| {
        let id = state.get(at).copied();
        machine.node(id.ok_or(PickleError::Malformed("a state with too few parts"))?)
    };
    match machine.node(target)? {
        // (version, byte order, …)
        Node::Dtype(dtype) => Ok(Node::Dtype(dtype.with_order(&*text(part(1)?)? == ">"))),
        // (version, shape, dtype, columns first, bytes or list)
        Node::Array(_) => {
            let shape = shape(machine, part(1)?)?;
            let dtype = dtype(part(2)?)?;
            let columns_first = matches!(part(3)?, Node::Number(flag) if *flag != 0.0);
            match part(4)? {
                Node::List(items) if dtype.is_object() => {
                    if count(&shape) != Some(items.len()) {
                        return Err(PickleError::Malformed(
                            "an array whose size differs from its shape",
                        ));
                    }
                    match shape.len() {
                        axes @ 0..=1 => Ok(Node::Objects {
                            list: list(state)?,
                            axes,
                        }),
                        _ => Err(PickleError::Malformed("objects in more than one axis")),
                    }
                }
                other => Ok(Node::Array(RawArray {
                    shape,
                    dtype,
                    columns_first,
                    data: bytes(other)?.into(),
                })),
            }
        }
        _ => Err(PickleError::Malformed("a state for a value without one")),
    }
}

/// The node of an array's elements in its state.
fn list(state: &[Id]) -> Result<Id, PickleError> {
    state
        .get(4)
        .copied()
        .ok_or(PickleError::Malformed("a state with too few parts"))
}

pub(super) fn text(node: &Node) -> Result<Rc<str>, PickleError> {
    match node {
        Node::Text(text) => Ok(text.clone()),
        _ => Err(PickleError::Malformed("a value that is not text")),
    }
}

fn bytes(node: &Node) -> Result<Rc<[u8]>, PickleError> {
    match node {
        Node::Bytes(bytes) => Ok(bytes.clone()),
        // Python 2's bytes are kept as text if they are readable.
        Node::Text(text) => Ok(text.clone().into()),
        _ => Err(PickleError::Malformed("a value that is not bytes")),
    }
}

pub(super) fn dtype(node: &Node) -> Result<Dtype, PickleError> {
    match node {
        Node::Dtype(dtype) => Ok(dtype.clone()),
        _ => Err(PickleError::Malformed("a value that is not a dtype")),
    }
}

pub(super) fn shape(machine: &Machine, node: &Node) -> Result<Vec<usize>, PickleError> {
    let Node::List(sides) = node else {
        return Err(PickleError::Malformed("a shape that is not a tuple"));
    };
    if sides.len() > 8 {
        return Err(PickleError::Malformed("a shape of over 8 axes"));
    }
    sides
        .iter()
        .map(|side| match machine.node(*side)? {
            Node::Number(side) if *side >= 0.0 && *side < 1e9 => Ok(*side as usize),
            _ => Err(PickleError::Malformed("a shape with an invalid length")),
        })
        .collect()
}
