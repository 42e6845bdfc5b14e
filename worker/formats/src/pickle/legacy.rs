//! Files of `torch.save` before torch 1.6, which pickles of tensors still contain: five pickles, then the
//! bytes of the storages.

use super::PickleError;
use super::machine::{Id, Machine, Node};
use super::storage::StorageBytes;
use crate::Value;
use std::collections::HashMap;
use std::rc::Rc;

/// The first pickle, a number of 80 bits, without the two bytes of its protocol.
pub(crate) const MAGIC: &[u8] = b"\x8a\x0al\xfc\x9cF\xf9 j\xa8P\x19.";
/// The second pickle.
const VERSION: f64 = 1001.0;

/// The value of a whole file.
pub(crate) fn read(bytes: &[u8]) -> Result<Value, PickleError> {
    let mut machine = Machine::new(bytes);
    let (root, _) = run(&mut machine)?;
    machine.unfold(root)
}

/// Runs the pickles and finds the storages. Returns the value, and the number of bytes of the pickles.
pub(super) fn run(machine: &mut Machine) -> Result<(Id, usize), PickleError> {
    let [first, _protocol] = machine.fixed::<2>()?;
    if first != 0x80 || machine.take(MAGIC.len())? != MAGIC {
        return Err(PickleError::Malformed("not a file of torch"));
    }
    let version = machine.run_apart()?;
    if !matches!(machine.node(version)?, Node::Number(version) if *version == VERSION) {
        return Err(PickleError::Malformed(
            "an unknown version of torch's files",
        ));
    }
    // Sizes of C's types and the byte order of the machine; storages don't depend on them.
    machine.run_apart()?;
    machine.storages = Some(HashMap::new());
    let root = machine.run_apart()?;
    let keys = machine.run_apart()?;
    let read = machine.at;
    let Node::List(keys) = machine.node(keys)? else {
        return Err(PickleError::Malformed("a file of torch without its keys"));
    };
    let keys: Result<Vec<Rc<str>>, _> = keys
        .iter()
        .map(|key| super::numpy::text(machine.node(*key)?))
        .collect();
    for key in keys? {
        storage(machine, &key)?;
    }
    Ok((root, read))
}

/// One storage: its number of elements, then their bytes.
fn storage(machine: &mut Machine, key: &str) -> Result<(), PickleError> {
    machine.fixed::<8>()?;
    let storages = machine.storages.as_ref();
    let entry = storages.and_then(|storages| storages.get(key));
    let size = entry.map(|entry| entry.size);
    let size = size.ok_or(PickleError::Malformed("a storage that nothing refers to"))?;
    let start = machine.at;
    machine.take(size)?;
    let range = start..machine.at;
    if let Some(entry) = machine.storages.as_mut().and_then(|all| all.get_mut(key)) {
        entry.data = Some(StorageBytes::File(range));
    }
    Ok(())
}
