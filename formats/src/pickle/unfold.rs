//! Builds a value from the parts of a pickle.

use super::machine::{Id, Machine, Node};
use super::{MAX_DEPTH, MAX_NUMBERS, MAX_VALUES, PickleError};
use crate::Value;

/// Bytes of text that count as one value.
const TEXT: usize = 64;

/// Remaining limits.
struct Left {
    values: usize,
    numbers: usize,
}

impl Left {
    fn values(&mut self, count: usize) -> Result<(), PickleError> {
        self.values = self
            .values
            .checked_sub(count)
            .ok_or(PickleError::TooLarge)?;
        Ok(())
    }
}

impl Machine<'_> {
    /// The value of a node and all below it.
    pub fn unfold(&self, root: Id) -> Result<Value, PickleError> {
        let mut left = Left {
            values: MAX_VALUES,
            numbers: MAX_NUMBERS,
        };
        self.value(root, MAX_DEPTH, &mut left)
    }

    fn value(&self, id: Id, depth: usize, left: &mut Left) -> Result<Value, PickleError> {
        left.values(1)?;
        let depth = depth.checked_sub(1).ok_or(PickleError::TooLarge)?;
        Ok(match self.node(id)? {
            Node::Number(value) => Value::Number(*value),
            Node::Text(text) => {
                left.values(text.len() / TEXT)?;
                Value::Text(text.to_string())
            }
            Node::List(items) => Value::List(self.values(items, depth, left)?),
            Node::Dict(entries) => {
                let entries = entries.iter().map(|(key, value)| {
                    Ok((
                        self.value(*key, depth, left)?,
                        self.value(*value, depth, left)?,
                    ))
                });
                Value::Dict(entries.collect::<Result<_, PickleError>>()?)
            }
            Node::Array(array) => {
                if array.is_text() {
                    left.values(array.len())?;
                }
                let numbers = left.numbers.checked_sub(array.len());
                left.numbers = numbers.ok_or(PickleError::TooLarge)?;
                array.value()?
            }
            Node::Objects { list, axes } => match (self.value(*list, depth, left)?, axes) {
                // An array without axes is its only element: numpy saves dictionaries this way.
                (Value::List(mut items), 0) => items.pop().unwrap_or(Value::Nothing),
                (items, _) => items,
            },
            Node::Object(class, fields) => Value::Object {
                class: class.to_string(),
                fields: Box::new(match fields {
                    Some(fields) => self.value(*fields, depth, left)?,
                    None => Value::Nothing,
                }),
            },
            Node::Nothing | Node::Bytes(_) | Node::Global(_) | Node::Dtype(_) => Value::Nothing,
        })
    }

    fn values(
        &self,
        items: &[Id],
        depth: usize,
        left: &mut Left,
    ) -> Result<Vec<Value>, PickleError> {
        items
            .iter()
            .map(|item| self.value(*item, depth, left))
            .collect()
    }
}
