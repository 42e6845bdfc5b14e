//! Tensors of torch: views, by offset and strides, of storages elsewhere in the file.

use super::machine::{Id, Machine, Node, StorageEntry};
use super::numpy::text;
use super::{PickleError, legacy};
use crate::array::count;
use crate::dtype::Dtype;
use crate::{Array, Value};
use std::collections::HashMap;
use std::ops::Range;
use std::rc::Rc;

/// Most axes of a tensor.
const MAX_AXES: usize = 8;

/// The value of a pickle. `find` gets its storages by key; each must have the requested size, bytes.
pub(crate) fn read<E: From<PickleError>>(
    bytes: &[u8],
    big_endian: bool,
    mut find: impl FnMut(&str, usize) -> Result<Vec<u8>, E>,
) -> Result<Value, E> {
    let mut machine = Machine::new(bytes);
    machine.storages = Some(HashMap::new());
    machine.big_endian = big_endian;
    let root = machine.run()?;
    for (key, entry) in machine.storages.iter_mut().flatten() {
        let found: Rc<[u8]> = find(key, entry.size)?.into();
        entry.data = Some(found.into());
    }
    Ok(machine.unfold(root)?)
}

/// A storage, as described by the pickle.
#[derive(Debug)]
pub(super) struct StorageHeader {
    dtype: Dtype,
    /// Number of elements.
    count: usize,
    location: Location,
}

/// Where the bytes are: elsewhere under a key, or at hand.
#[derive(Debug)]
enum Location {
    Key(Rc<str>),
    Here(StorageBytes),
}

/// Bytes of numbers, not copied if they are part of the file.
#[derive(Clone, Debug)]
pub(super) enum StorageBytes {
    /// A range of the file.
    File(Range<usize>),
    /// A range of other bytes.
    Held(Rc<[u8]>, Range<usize>),
}

impl Default for StorageBytes {
    fn default() -> Self {
        Self::File(0..0)
    }
}

impl From<Rc<[u8]>> for StorageBytes {
    fn from(bytes: Rc<[u8]>) -> Self {
        let all = 0..bytes.len();
        Self::Held(bytes, all)
    }
}

impl StorageBytes {
    /// Number of bytes.
    pub(super) fn len(&self) -> usize {
        match self {
            Self::File(range) | Self::Held(_, range) => range.len(),
        }
    }

    /// The bytes; `file` is the whole file.
    pub(super) fn bytes<'a>(&'a self, file: &'a [u8]) -> &'a [u8] {
        match self {
            Self::File(range) => file.get(range.clone()),
            Self::Held(bytes, range) => bytes.get(range.clone()),
        }
        .unwrap_or_default()
    }
}

/// The storage that a persistent reference names: `("storage", class, key, device, number of elements)`, perhaps with a view.
/// In torch, `persistent_load` of its unpickler reads it.
pub(super) fn persistent_load(machine: &mut Machine, reference: Id) -> Result<Node, PickleError> {
    const BAD: PickleError = PickleError::Malformed("a reference that is not to a storage");
    let Node::List(parts) = machine.node(reference)? else {
        return Err(BAD);
    };
    let &[kind, class, key, _device, elements, ref view @ ..] = parts.as_slice() else {
        return Err(BAD);
    };
    if &*text(machine.node(kind)?)? != "storage" {
        return Err(BAD);
    }
    if let Some(view) = view.first()
        && !matches!(machine.node(*view)?, Node::Nothing)
    {
        return Err(PickleError::Malformed("a storage that is part of another"));
    }
    let dtype = match machine.node(class)? {
        Node::Global(class) => element(class)?.with_order(machine.big_endian),
        _ => return Err(BAD),
    };
    let key = text(machine.node(key)?)?;
    let Node::Number(elements) = machine.node(elements)? else {
        return Err(BAD);
    };
    let elements = length(*elements)?;
    let size = dtype.size().and_then(|size| size.checked_mul(elements));
    let size = size.ok_or(PickleError::TooLarge)?;
    let storages = machine.storages.get_or_insert_default();
    let entry = storages
        .entry(key.clone())
        .or_insert(StorageEntry { size, data: None });
    if entry.size != size {
        return Err(PickleError::Malformed("a storage of two sizes"));
    }
    Ok(Node::Storage(Rc::new(StorageHeader {
        dtype,
        count: elements,
        location: Location::Key(key),
    })))
}

/// The element type of a class of storages.
fn element(class: &Rc<str>) -> Result<Dtype, PickleError> {
    Ok(Dtype::new(match &**class {
        "torch.FloatStorage" => "f4",
        "torch.DoubleStorage" => "f8",
        "torch.HalfStorage" => "f2",
        "torch.BFloat16Storage" => "bf2",
        "torch.LongStorage" => "i8",
        "torch.IntStorage" => "i4",
        "torch.ShortStorage" => "i2",
        "torch.CharStorage" => "i1",
        "torch.ByteStorage" => "u1",
        "torch.BoolStorage" => "b1",
        _ => return Err(PickleError::Call(class.to_string())),
    }))
}

/// The storage in the bytes of a whole torch file, as `torch.storage._load_from_bytes` reads it: other pickles contain tensors
/// in this form.
pub(super) fn load_from_bytes(machine: &Machine, bytes: &Rc<[u8]>) -> Result<Node, PickleError> {
    const BAD: PickleError = PickleError::Malformed("bytes of torch that are not a storage");
    if machine.nested {
        return Err(PickleError::Malformed("a file of torch in a file of torch"));
    }
    let mut file = Machine::new(bytes);
    file.nested = true;
    // The file and all files in it share one limit.
    file.encoded.set(machine.encoded.get());
    let (root, read) = legacy::run(&mut file)?;
    machine.encoded.set(file.encoded.get());
    machine.spend(read)?;
    let Node::Storage(header) = file.node(root)? else {
        return Err(BAD);
    };
    let Location::Key(key) = &header.location else {
        return Err(BAD);
    };
    let entry = file.storages.as_ref().and_then(|all| all.get(key));
    let Some(StorageBytes::File(range)) = entry.and_then(|entry| entry.data.clone()) else {
        return Err(BAD);
    };
    Ok(Node::Storage(Rc::new(StorageHeader {
        dtype: header.dtype.clone(),
        count: header.count,
        location: Location::Here(StorageBytes::Held(bytes.clone(), range)),
    })))
}

/// A view of a storage.
#[derive(Clone, Debug)]
pub(super) struct Tensor {
    storage: Rc<StorageHeader>,
    offset: usize,
    size: Vec<usize>,
    stride: Vec<usize>,
}

/// A tensor, after a check that it reads nothing beyond its storage.
pub(super) fn tensor(
    storage: &Node,
    offset: usize,
    size: Vec<usize>,
    stride: Vec<usize>,
) -> Result<Node, PickleError> {
    let Node::Storage(storage) = storage else {
        return Err(PickleError::Malformed(
            "a tensor of a value without numbers",
        ));
    };
    if size.len() != stride.len() {
        return Err(PickleError::Malformed(
            "a tensor with more or fewer strides than axes",
        ));
    }
    // Index of the last element that the tensor reads.
    let last = size
        .iter()
        .zip(&stride)
        .try_fold(offset, |last, (side, stride)| {
            last.checked_add(side.saturating_sub(1).checked_mul(*stride)?)
        });
    if !size.contains(&0) && last.is_none_or(|last| last >= storage.count) {
        return Err(PickleError::Malformed("a tensor that exceeds its storage"));
    }
    Ok(Node::Tensor(Tensor {
        storage: storage.clone(),
        offset,
        size,
        stride,
    }))
}

/// Reads the lengths of axes, or the strides, from a tuple of the pickle.
pub(super) fn lengths(machine: &Machine, node: &Node) -> Result<Vec<usize>, PickleError> {
    let Node::List(items) = node else {
        return Err(PickleError::Malformed("a tensor's size is not a tuple"));
    };
    if items.len() > MAX_AXES {
        return Err(PickleError::Malformed("a tensor of over 8 axes"));
    }
    let items = items.iter().map(|item| match machine.node(*item)? {
        Node::Number(number) => length(*number),
        _ => Err(PickleError::Malformed("a tensor's size is not numbers")),
    });
    items.collect()
}

/// A whole number from 0 on. Below the bound, f64 is exact; the comparison also refuses NaN.
pub(super) fn length(number: f64) -> Result<usize, PickleError> {
    if (0.0..1e12).contains(&number) && number.fract() == 0.0 {
        Ok(number as usize)
    } else {
        Err(PickleError::Malformed("a tensor with an invalid length"))
    }
}

impl Tensor {
    /// Number of elements, unless it overflows.
    pub(super) fn count(&self) -> Option<usize> {
        count(&self.size)
    }

    /// Number of elements in the storage.
    pub(super) fn storage_len(&self) -> usize {
        self.storage.count
    }

    /// The numbers. It allocates memory for [`Self::count`] numbers, so the count must be checked before.
    pub(super) fn array(&self, machine: &Machine) -> Result<Array, PickleError> {
        const MISSING: PickleError = PickleError::Malformed("the numbers of a tensor are missing");
        let data = match &self.storage.location {
            Location::Here(data) => data,
            Location::Key(key) => {
                let entry = machine.storages.as_ref().and_then(|all| all.get(key));
                entry.and_then(|entry| entry.data.as_ref()).ok_or(MISSING)?
            }
        };
        let bytes = data.bytes(machine.bytes);
        let size = self.storage.dtype.size().ok_or(MISSING)?;
        let mut gathered = Vec::new();
        let mut at = vec![0; self.size.len()];
        for _ in 0..self.count().ok_or(PickleError::TooLarge)? {
            let steps = at.iter().zip(&self.stride).map(|(at, stride)| at * stride);
            let start = (self.offset + steps.sum::<usize>()) * size;
            gathered.extend(bytes.get(start..start + size).ok_or(MISSING)?);
            for (index, side) in at.iter_mut().zip(&self.size).rev() {
                *index += 1;
                if *index < *side {
                    break;
                }
                *index = 0;
            }
        }
        let values = self.storage.dtype.numbers(&gathered).ok_or(MISSING)?;
        Ok(Array {
            shape: self.size.clone(),
            values,
        })
    }
}
