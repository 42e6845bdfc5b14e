//! Builds a value from the parts of a pickle.

use super::budget::Budget;
use super::machine::{Id, Machine, Node};
use super::{MAX_DEPTH, PickleError};
use crate::Value;

/// Bytes of text, or of bytes, that count as one value.
const TEXT: usize = 64;

impl Machine<'_> {
    /// The value of a node with everything below it, except the values of the keys in `self.without`.
    pub(super) fn unfold(&self, root: Id) -> Result<Value, PickleError> {
        self.unfold_within(root, &mut Budget::default())
    }

    /// Unfolds as [`Self::unfold`] does, within the file's `budget`.
    pub(super) fn unfold_within(
        &self,
        root: Id,
        budget: &mut Budget,
    ) -> Result<Value, PickleError> {
        self.value(root, MAX_DEPTH, budget)
    }

    fn value(&self, id: Id, depth: usize, left: &mut Budget) -> Result<Value, PickleError> {
        left.values(1)?;
        // Bounds the recursion, also for a list that contains itself.
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
                    let key = self.value(*key, depth, left)?;
                    let value = match key.text() {
                        Some(key) if self.without.contains(&key) => Value::Nothing,
                        _ => self.value(*value, depth, left)?,
                    };
                    Ok((key, value))
                });
                Value::Dict(entries.collect::<Result<_, PickleError>>()?)
            }
            Node::Array(array) => {
                if array.is_text() {
                    left.values(array.len() + array.data.len() / TEXT)?;
                }
                left.numbers(array.len())?;
                array.value(self.bytes)?
            }
            Node::Tensor(tensor) => {
                let count = tensor.count().ok_or(PickleError::TooLarge)?;
                left.numbers(count)?;
                // A stride of 0 repeats a few stored numbers any number of times.
                let beyond = count.saturating_sub(tensor.storage_len());
                left.expanded(beyond)?;
                Value::Array(tensor.array(self)?)
            }
            Node::Bytes(bytes) => {
                left.values(bytes.len() / TEXT)?;
                Value::Bytes(bytes.to_vec())
            }
            Node::Objects { list, axes } => match (self.value(*list, depth, left)?, axes) {
                // An array without axes stands for its only element: numpy saves dictionaries in this way.
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
            Node::Nothing | Node::Global(_) | Node::Dtype(_) | Node::Storage(_) => Value::Nothing,
        })
    }

    fn values(
        &self,
        items: &[Id],
        depth: usize,
        left: &mut Budget,
    ) -> Result<Vec<Value>, PickleError> {
        items
            .iter()
            .map(|item| self.value(*item, depth, left))
            .collect()
    }
}
