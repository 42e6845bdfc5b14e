//! The stack machine that a pickle is a program of, with data instructions only.

use super::numpy::{self, Array, Kind};
use super::{MAX_DEPTH, MAX_VALUES, PickleError, Value};
use std::collections::HashMap;

/// Place of a node: lists and dictionaries go on growing after they were put aside, so that the
/// stack holds places and not values.
pub(super) type Id = usize;

/// What a pickle builds.
#[derive(Clone, Debug)]
pub(super) enum Node {
    Nothing,
    Number(f64),
    Text(String),
    Bytes(Vec<u8>),
    List(Vec<Id>),
    Dict(Vec<(Id, Id)>),
    /// A function or class, by its full name.
    Global(String),
    Kind(Kind),
    Array(Array),
}

pub(super) struct Machine<'a> {
    bytes: &'a [u8],
    at: usize,
    pub(super) nodes: Vec<Node>,
    stack: Vec<Id>,
    marks: Vec<usize>,
    memo: HashMap<u32, Id>,
}

impl<'a> Machine<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self {
            bytes,
            at: 0,
            nodes: Vec::new(),
            stack: Vec::new(),
            marks: Vec::new(),
            memo: HashMap::new(),
        }
    }

    /// Runs to STOP and unfolds what is on the stack then.
    pub fn run(mut self) -> Result<Value, PickleError> {
        loop {
            let [instruction] = self.fixed::<1>()?;
            if instruction == b'.' {
                let root = self.pop()?;
                let mut left = MAX_VALUES;
                return self.unfold(root, MAX_DEPTH, &mut left);
            }
            self.execute(instruction)?;
        }
    }

    fn execute(&mut self, instruction: u8) -> Result<(), PickleError> {
        match instruction {
            // PROTO, FRAME: nothing to do.
            0x80 => drop(self.fixed::<1>()?),
            0x95 => drop(self.fixed::<8>()?),
            b'N' => self.push(Node::Nothing),
            0x88 => self.push(Node::Number(1.0)),
            0x89 => self.push(Node::Number(0.0)),
            b'K' => {
                let [value] = self.fixed::<1>()?;
                self.push(Node::Number(f64::from(value)));
            }
            b'M' => {
                let value = u16::from_le_bytes(self.fixed()?);
                self.push(Node::Number(f64::from(value)));
            }
            b'J' => {
                let value = i32::from_le_bytes(self.fixed()?);
                self.push(Node::Number(f64::from(value)));
            }
            0x8a => self.long()?,
            b'G' => {
                let value = f64::from_be_bytes(self.fixed()?);
                self.push(Node::Number(value));
            }
            b'U' | 0x8c | b'C' => {
                let [length] = self.fixed::<1>()?;
                self.string(instruction, usize::from(length))?;
            }
            b'T' | b'X' | b'B' => {
                let length = u32::from_le_bytes(self.fixed()?) as usize;
                self.string(instruction, length)?;
            }
            0x8d | 0x8e | 0x96 => {
                let length = u64::from_le_bytes(self.fixed()?);
                let length = usize::try_from(length).map_err(|_| PickleError::Truncated)?;
                self.string(instruction, length)?;
            }
            b'(' => self.marks.push(self.stack.len()),
            b']' | b')' => self.push(Node::List(Vec::new())),
            b'}' => self.push(Node::Dict(Vec::new())),
            b'l' | b't' => {
                let items = self.since_mark()?;
                self.push(Node::List(items));
            }
            0x85..=0x87 => {
                let count = usize::from(instruction - 0x84);
                let start = self.stack.len().checked_sub(count);
                let items = self.stack.split_off(start.ok_or(EMPTY)?);
                self.push(Node::List(items));
            }
            b'a' => {
                let item = self.pop()?;
                self.append(vec![item])?;
            }
            b'e' => {
                let items = self.since_mark()?;
                self.append(items)?;
            }
            b's' => {
                let value = self.pop()?;
                let key = self.pop()?;
                self.set(&[key, value])?;
            }
            b'u' => {
                let items = self.since_mark()?;
                self.set(&items)?;
            }
            b'd' => {
                let items = self.since_mark()?;
                self.push(Node::Dict(Vec::new()));
                self.set(&items)?;
            }
            b'q' => {
                let [place] = self.fixed::<1>()?;
                self.remember(u32::from(place))?;
            }
            b'r' => {
                let place = u32::from_le_bytes(self.fixed()?);
                self.remember(place)?;
            }
            0x94 => self.remember(self.memo.len() as u32)?,
            b'h' => {
                let [place] = self.fixed::<1>()?;
                self.recall(u32::from(place))?;
            }
            b'j' => {
                let place = u32::from_le_bytes(self.fixed()?);
                self.recall(place)?;
            }
            b'0' => drop(self.pop()?),
            b'c' => {
                let (module, name) = (self.line()?, self.line()?);
                self.push(Node::Global(format!("{module}.{name}")));
            }
            0x93 => {
                let (name, module) = (self.pop()?, self.pop()?);
                let full = match (self.node(module)?, self.node(name)?) {
                    (Node::Text(module), Node::Text(name)) => format!("{module}.{name}"),
                    _ => return Err(PickleError::Malformed("a name that is no text")),
                };
                self.push(Node::Global(full));
            }
            b'R' => {
                let (arguments, function) = (self.pop()?, self.pop()?);
                let result = numpy::call(self, function, arguments)?;
                self.push(result);
            }
            b'b' => {
                let state = self.pop()?;
                let target = self.top()?;
                let built = numpy::build(self, target, state)?;
                if let Some(node) = self.nodes.get_mut(target) {
                    *node = built;
                }
            }
            other => return Err(PickleError::Instruction(other)),
        }
        Ok(())
    }

    /// The node at a place.
    pub fn node(&self, id: Id) -> Result<&Node, PickleError> {
        self.nodes
            .get(id)
            .ok_or(PickleError::Malformed("a place that is not there"))
    }

    fn take(&mut self, length: usize) -> Result<&'a [u8], PickleError> {
        let end = self.at.checked_add(length).ok_or(PickleError::Truncated)?;
        let bytes = self.bytes.get(self.at..end).ok_or(PickleError::Truncated)?;
        self.at = end;
        Ok(bytes)
    }

    fn fixed<const N: usize>(&mut self) -> Result<[u8; N], PickleError> {
        self.take(N)?.try_into().map_err(|_| PickleError::Truncated)
    }

    fn line(&mut self) -> Result<String, PickleError> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let length = rest.iter().position(|b| *b == b'\n');
        let line = self.take(length.ok_or(PickleError::Truncated)?)?;
        self.take(1)?;
        Ok(String::from_utf8_lossy(line).into_owned())
    }

    /// Text (X, 0x8c, 0x8d), or bytes: Python 2's strings may be either and are kept as bytes
    /// unless they are ASCII, which names are.
    fn string(&mut self, instruction: u8, length: usize) -> Result<(), PickleError> {
        let bytes = self.take(length)?;
        let text = || String::from_utf8_lossy(bytes).into_owned();
        self.push(match instruction {
            b'X' | 0x8c | 0x8d => Node::Text(text()),
            b'U' | b'T' if bytes.iter().all(|b| (32..127).contains(b)) => Node::Text(text()),
            _ => Node::Bytes(bytes.to_vec()),
        });
        Ok(())
    }

    fn long(&mut self) -> Result<(), PickleError> {
        let [length] = self.fixed::<1>()?;
        let bytes = self.take(usize::from(length))?;
        let negative = bytes.last().is_some_and(|b| *b >= 0x80);
        let mut whole = [if negative { 0xff } else { 0 }; 8];
        let place = whole
            .get_mut(..bytes.len())
            .ok_or(PickleError::Malformed("a number of over 64 bits"))?;
        place.copy_from_slice(bytes);
        self.push(Node::Number(i64::from_le_bytes(whole) as f64));
        Ok(())
    }

    fn push(&mut self, node: Node) {
        self.nodes.push(node);
        self.stack.push(self.nodes.len() - 1);
    }

    fn pop(&mut self) -> Result<Id, PickleError> {
        self.stack.pop().ok_or(EMPTY)
    }

    fn top(&self) -> Result<Id, PickleError> {
        self.stack.last().copied().ok_or(EMPTY)
    }

    fn since_mark(&mut self) -> Result<Vec<Id>, PickleError> {
        let mark = self.marks.pop().ok_or(EMPTY)?;
        if mark > self.stack.len() {
            return Err(EMPTY);
        }
        Ok(self.stack.split_off(mark))
    }

    fn append(&mut self, items: Vec<Id>) -> Result<(), PickleError> {
        let top = self.top()?;
        match self.nodes.get_mut(top) {
            Some(Node::List(list)) => {
                list.extend(items);
                Ok(())
            }
            _ => Err(PickleError::Malformed("appending to what is no list")),
        }
    }

    fn set(&mut self, items: &[Id]) -> Result<(), PickleError> {
        let top = self.top()?;
        match self.nodes.get_mut(top) {
            Some(Node::Dict(entries)) => {
                let (pairs, _) = items.as_chunks::<2>();
                entries.extend(pairs.iter().map(|[key, value]| (*key, *value)));
                Ok(())
            }
            _ => Err(PickleError::Malformed("an entry of what is no dictionary")),
        }
    }

    fn remember(&mut self, place: u32) -> Result<(), PickleError> {
        let top = self.top()?;
        self.memo.insert(place, top);
        Ok(())
    }

    fn recall(&mut self, place: u32) -> Result<(), PickleError> {
        let id = self.memo.get(&place).copied();
        self.stack
            .push(id.ok_or(PickleError::Malformed("a memory that is not there"))?);
        Ok(())
    }

    fn unfold(&self, id: Id, depth: usize, left: &mut usize) -> Result<Value, PickleError> {
        *left = left.checked_sub(1).ok_or(PickleError::TooLarge)?;
        let depth = depth.checked_sub(1).ok_or(PickleError::TooLarge)?;
        Ok(match self.node(id)? {
            Node::Number(value) => Value::Number(*value),
            Node::Text(text) => Value::Text(text.clone()),
            Node::List(items) => {
                let items = items.iter().map(|item| self.unfold(*item, depth, left));
                Value::List(items.collect::<Result<_, _>>()?)
            }
            Node::Dict(entries) => {
                let entries = entries.iter().map(|(key, value)| {
                    Ok((
                        self.unfold(*key, depth, left)?,
                        self.unfold(*value, depth, left)?,
                    ))
                });
                Value::Dict(entries.collect::<Result<_, PickleError>>()?)
            }
            Node::Array(array) => array.value()?,
            Node::Nothing | Node::Bytes(_) | Node::Global(_) | Node::Kind(_) => Value::Nothing,
        })
    }
}

const EMPTY: PickleError = PickleError::Malformed("an instruction without its operands");
