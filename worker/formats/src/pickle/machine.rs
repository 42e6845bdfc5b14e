//! The state of the stack machine that runs a pickle.

use super::numpy::RawArray;
use super::storage::{StorageBytes, StorageHeader, Tensor};
use super::{MAX_ENCODED, MAX_NODES, PickleError};
use crate::dtype::Dtype;
use std::cell::Cell;
use std::collections::HashMap;
use std::mem;
use std::rc::Rc;

/// Index of a node. Lists and dictionaries still grow after they are stored in the memo, so the stack
/// holds indices instead of values. A file can make a list contain itself; indices make that harmless.
pub(super) type Id = usize;

/// A part of the result. Text and bytes are shared, since a few instructions can refer to the same
/// megabytes a million times.
#[derive(Clone, Debug)]
pub(super) enum Node {
    Nothing,
    Number(f64),
    Text(Rc<str>),
    Bytes(Rc<[u8]>),
    List(Vec<Id>),
    Dict(Vec<(Id, Id)>),
    /// A function or class, by its full name.
    Global(Rc<str>),
    Dtype(Dtype),
    Array(RawArray),
    /// An array of objects, of one axis or none.
    Objects {
        list: Id,
        axes: usize,
    },
    /// An object of a class that is read as data, and its fields, once they are known.
    Object(Rc<str>, Option<Id>),
    /// A storage of numbers; tensors of torch are views of it.
    Storage(Rc<StorageHeader>),
    Tensor(Tensor),
}

pub(super) struct Machine<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) at: usize,
    nodes: Vec<Node>,
    pub(super) stack: Vec<Id>,
    pub(super) marks: Vec<usize>,
    memo: HashMap<u32, Id>,
    /// Bytes so far that calls have created, and of pickles inside this one.
    pub(super) encoded: Cell<usize>,
    /// Whether this is a pickle inside another. It must not contain a third one, which bounds the recursion.
    pub(super) nested: bool,
    /// Storages of torch by key. Without them, a reference to one is an unknown instruction.
    pub(super) storages: Option<HashMap<Rc<str>, StorageEntry>>,
    /// Whether the storages' numbers are big-endian.
    pub(super) big_endian: bool,
    /// Keys whose values are left out of the result.
    pub(super) without: &'a [&'a str],
}

/// A storage that a file of torch refers to.
#[derive(Debug)]
pub(super) struct StorageEntry {
    /// Declared size of the storage, bytes.
    pub size: usize,
    /// The bytes, once they are found.
    pub data: Option<StorageBytes>,
}

/// The stack is too short for an instruction.
pub(super) const EMPTY: PickleError = PickleError::Malformed("an instruction without its operands");

impl<'a> Machine<'a> {
    /// Counts `bytes` that a call creates: an instruction of a few bytes may create many, again and again.
    pub(super) fn spend(&self, bytes: usize) -> Result<(), PickleError> {
        self.encoded.set(self.encoded.get().saturating_add(bytes));
        if self.encoded.get() > MAX_ENCODED {
            return Err(PickleError::TooLarge);
        }
        Ok(())
    }

    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self {
            bytes,
            at: 0,
            nodes: Vec::new(),
            stack: Vec::new(),
            marks: Vec::new(),
            memo: HashMap::new(),
            encoded: Cell::new(0),
            nested: false,
            storages: None,
            big_endian: false,
            without: &[],
        }
    }

    /// Runs up to STOP, and returns the top of the stack: the value of the pickle.
    ///
    /// Every instruction takes at least a byte of the file, so this ends.
    pub(super) fn run(&mut self) -> Result<Id, PickleError> {
        loop {
            let [instruction] = self.fixed::<1>()?;
            if instruction == b'.' {
                return self.pop();
            }
            self.execute(instruction)?;
        }
    }

    /// Runs a whole pickle that starts here, with a stack and a memo of its own.
    pub(super) fn run_apart(&mut self) -> Result<Id, PickleError> {
        let stack = mem::take(&mut self.stack);
        let marks = mem::take(&mut self.marks);
        let memo = mem::take(&mut self.memo);
        let result = self.run();
        (self.stack, self.marks, self.memo) = (stack, marks, memo);
        result
    }

    /// The node with this index.
    pub(super) fn node(&self, id: Id) -> Result<&Node, PickleError> {
        self.nodes
            .get(id)
            .ok_or(PickleError::Malformed("an unknown node"))
    }

    /// Replaces the node with this index.
    pub(super) fn replace(&mut self, id: Id, node: Node) {
        if let Some(old) = self.nodes.get_mut(id) {
            *old = node;
        }
    }

    /// The next `length` bytes of the file.
    pub(super) fn take(&mut self, length: usize) -> Result<&'a [u8], PickleError> {
        let end = self.at.checked_add(length).ok_or(PickleError::Truncated)?;
        let bytes = self.bytes.get(self.at..end).ok_or(PickleError::Truncated)?;
        self.at = end;
        Ok(bytes)
    }

    /// The next `N` bytes of the file, as an array.
    pub(super) fn fixed<const N: usize>(&mut self) -> Result<[u8; N], PickleError> {
        self.take(N)?.try_into().map_err(|_| PickleError::Truncated)
    }

    /// The bytes up to the next line feed, without it.
    pub(super) fn line(&mut self) -> Result<&'a [u8], PickleError> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let length = rest.iter().position(|b| *b == b'\n');
        let line = self.take(length.ok_or(PickleError::Truncated)?)?;
        self.take(1)?;
        Ok(line)
    }

    pub(super) fn push(&mut self, node: Node) -> Result<(), PickleError> {
        if self.nodes.len() >= MAX_NODES {
            return Err(PickleError::TooLarge);
        }
        self.nodes.push(node);
        self.stack.push(self.nodes.len() - 1);
        Ok(())
    }

    pub(super) fn pop(&mut self) -> Result<Id, PickleError> {
        self.stack.pop().ok_or(EMPTY)
    }

    pub(super) fn top(&self) -> Result<Id, PickleError> {
        self.stack.last().copied().ok_or(EMPTY)
    }

    /// Pops everything since the last MARK.
    pub(super) fn since_mark(&mut self) -> Result<Vec<Id>, PickleError> {
        let mark = self.marks.pop().ok_or(EMPTY)?;
        // A hostile file may pop below its mark; `split_off` would panic.
        if mark > self.stack.len() {
            return Err(EMPTY);
        }
        Ok(self.stack.split_off(mark))
    }

    /// Appends to the list on top of the stack.
    pub(super) fn append(&mut self, items: Vec<Id>) -> Result<(), PickleError> {
        let top = self.top()?;
        match self.nodes.get_mut(top) {
            Some(Node::List(list)) => {
                list.extend(items);
                Ok(())
            }
            _ => Err(PickleError::Malformed(
                "append to a value that is not a list",
            )),
        }
    }

    /// Adds alternating keys and values to the dictionary on top of the stack.
    pub(super) fn set(&mut self, items: &[Id]) -> Result<(), PickleError> {
        let top = self.top()?;
        match self.nodes.get_mut(top) {
            Some(Node::Dict(entries)) => {
                let (pairs, _) = items.as_chunks::<2>();
                entries.extend(pairs.iter().map(|[key, value]| (*key, *value)));
                Ok(())
            }
            _ => Err(PickleError::Malformed(
                "an entry for a value that is not a dictionary",
            )),
        }
    }

    /// Stores the top of the stack in the memo; `None` takes the next key.
    pub(super) fn remember(&mut self, key: Option<u32>) -> Result<(), PickleError> {
        let top = self.top()?;
        let key = key.unwrap_or(self.memo.len() as u32);
        self.memo.insert(key, top);
        Ok(())
    }

    /// Pushes the memo's entry `key`.
    pub(super) fn recall(&mut self, key: u32) -> Result<(), PickleError> {
        let id = self.memo.get(&key).copied();
        self.stack
            .push(id.ok_or(PickleError::Malformed("an unknown memo"))?);
        Ok(())
    }
}
