//! Limits of the data that a file may produce: a few bytes of a pickle can stand for any amount of data.

use super::{MAX_EXPANDED, MAX_NUMBERS, MAX_UNPACKED, MAX_VALUES, PickleError};

/// The remaining limits of one file, which may hold many pickles.
#[derive(Clone, Debug)]
pub(crate) struct Budget {
    /// Bytes that compressed pickles may unpack to.
    pub unpacked: u64,
    values: usize,
    numbers: usize,
    expanded: usize,
}

impl Default for Budget {
    fn default() -> Self {
        Self {
            unpacked: MAX_UNPACKED,
            values: MAX_VALUES,
            numbers: MAX_NUMBERS,
            expanded: MAX_EXPANDED,
        }
    }
}

impl Budget {
    /// Takes `count` values.
    pub(super) fn values(&mut self, count: usize) -> Result<(), PickleError> {
        take(&mut self.values, count)
    }

    /// Takes `count` numbers of arrays.
    pub(super) fn numbers(&mut self, count: usize) -> Result<(), PickleError> {
        take(&mut self.numbers, count)
    }

    /// Takes `count` numbers that a tensor has beyond its storage's.
    pub(super) fn expanded(&mut self, count: usize) -> Result<(), PickleError> {
        take(&mut self.expanded, count)
    }
}

fn take(left: &mut usize, count: usize) -> Result<(), PickleError> {
    *left = left.checked_sub(count).ok_or(PickleError::TooLarge)?;
    Ok(())
}
