//! The effect of each instruction that builds data.

use super::machine::{EMPTY, Machine, Node};
use super::{MAX_NAME, PickleError, joblib, numpy, storage};

impl Machine<'_> {
    pub(super) fn execute(&mut self, instruction: u8) -> Result<(), PickleError> {
        match instruction {
            // PROTO, FRAME: nothing to do.
            0x80 => drop(self.fixed::<1>()?),
            0x95 => drop(self.fixed::<8>()?),
            b'N' => self.push(Node::Nothing)?,
            0x88 => self.push(Node::Number(1.0))?,
            0x89 => self.push(Node::Number(0.0))?,
            b'K' => {
                let [value] = self.fixed::<1>()?;
                self.push(Node::Number(f64::from(value)))?;
            }
            b'M' => {
                let value = u16::from_le_bytes(self.fixed()?);
                self.push(Node::Number(f64::from(value)))?;
            }
            b'J' => {
                let value = i32::from_le_bytes(self.fixed()?);
                self.push(Node::Number(f64::from(value)))?;
            }
            0x8a => self.long()?,
            b'G' => {
                let value = f64::from_be_bytes(self.fixed()?);
                self.push(Node::Number(value))?;
            }
            b'I' | b'L' | b'F' | b'S' | b'V' => self.literal(instruction)?,
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
            b'1' => drop(self.since_mark()?),
            b'0' => drop(self.pop()?),
            b'2' => {
                let top = self.top()?;
                self.stack.push(top);
            }
            b']' | b')' | 0x8f => self.push(Node::List(Vec::new()))?,
            b'}' => self.push(Node::Dict(Vec::new()))?,
            b'l' | b't' | 0x91 => {
                let items = self.since_mark()?;
                self.push(Node::List(items))?;
            }
            0x85..=0x87 => {
                let count = usize::from(instruction - 0x84);
                let start = self.stack.len().checked_sub(count);
                let items = self.stack.split_off(start.ok_or(EMPTY)?);
                self.push(Node::List(items))?;
            }
            b'a' => {
                let item = self.pop()?;
                self.append(vec![item])?;
            }
            b'e' | 0x90 => {
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
                self.push(Node::Dict(Vec::new()))?;
                self.set(&items)?;
            }
            b'q' => {
                let [key] = self.fixed::<1>()?;
                self.remember(Some(u32::from(key)))?;
            }
            b'r' => {
                let key = u32::from_le_bytes(self.fixed()?);
                self.remember(Some(key))?;
            }
            b'p' => {
                let key = self.memo_key()?;
                self.remember(Some(key))?;
            }
            0x94 => self.remember(None)?,
            b'h' => {
                let [key] = self.fixed::<1>()?;
                self.recall(u32::from(key))?;
            }
            b'j' => {
                let key = u32::from_le_bytes(self.fixed()?);
                self.recall(key)?;
            }
            b'g' => {
                let key = self.memo_key()?;
                self.recall(key)?;
            }
            b'c' => {
                let (module, name) = (self.line()?, self.line()?);
                let text = |bytes| String::from_utf8_lossy(bytes).into_owned();
                self.global(&text(module), &text(name))?;
            }
            0x93 => {
                let (name, module) = (self.pop()?, self.pop()?);
                let (module, name) = match (self.node(module)?, self.node(name)?) {
                    (Node::Text(module), Node::Text(name)) => (module.clone(), name.clone()),
                    _ => return Err(PickleError::Malformed("a name that is not text")),
                };
                self.global(&module, &name)?;
            }
            b'R' | 0x81 => {
                let (arguments, function) = (self.pop()?, self.pop()?);
                let result = numpy::call(self, function, arguments)?;
                self.push(result)?;
            }
            b'b' => {
                let state = self.pop()?;
                let target = self.top()?;
                let built = if joblib::is_wrapper(self.node(target)?) {
                    joblib::array(self, state)?
                } else {
                    numpy::build(self, target, state)?
                };
                self.replace(target, built);
            }
            b'Q' if self.storages.is_some() => {
                let reference = self.pop()?;
                let storage = storage::persistent_load(self, reference)?;
                self.push(storage)?;
            }
            other => return Err(PickleError::Instruction(other)),
        }
        Ok(())
    }

    fn global(&mut self, module: &str, name: &str) -> Result<(), PickleError> {
        if module.len() + name.len() > MAX_NAME {
            return Err(PickleError::Malformed("an invalid name"));
        }
        self.push(Node::Global(format!("{module}.{name}").into()))
    }

    /// Text (X, 0x8c, 0x8d) or bytes. Python 2's strings may be either. They are kept as bytes unless they
    /// are ASCII, as names are.
    fn string(&mut self, instruction: u8, length: usize) -> Result<(), PickleError> {
        let bytes = self.take(length)?;
        match instruction {
            b'X' | 0x8c | 0x8d => self.push(Node::Text(String::from_utf8_lossy(bytes).into())),
            b'U' | b'T' => self.old_string(bytes),
            _ => self.push(Node::Bytes(bytes.into())),
        }
    }

    /// A string in Python 2.
    pub(super) fn old_string(&mut self, bytes: &[u8]) -> Result<(), PickleError> {
        let readable = bytes.iter().all(|b| (32..127).contains(b));
        match str::from_utf8(bytes) {
            Ok(text) if readable => self.push(Node::Text(text.into())),
            _ => self.push(Node::Bytes(bytes.into())),
        }
    }

    fn long(&mut self) -> Result<(), PickleError> {
        let [length] = self.fixed::<1>()?;
        let bytes = self.take(usize::from(length))?;
        let negative = bytes.last().is_some_and(|b| *b >= 0x80);
        // Little-endian two's complement of any length: the sign fills the remaining bytes.
        let mut whole = [if negative { 0xff } else { 0 }; 8];
        let low = whole
            .get_mut(..bytes.len())
            .ok_or(PickleError::Malformed("a number of over 64 bits"))?;
        low.copy_from_slice(bytes);
        self.push(Node::Number(i64::from_le_bytes(whole) as f64))
    }
}
