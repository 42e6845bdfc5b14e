//! HumanNeRF's captures, in two forms: a wild video with SMPL's parameters, or prepared for training.

mod frame_files;
mod prepared;
mod wild;

use crate::source::Source;
use crate::{ImportError, Imported, Options};

/// Reads whichever form the files have; the prepared one if they have both.
pub(crate) fn read(source: &Source, options: &Options) -> Result<Imported, ImportError> {
    if source.has(wild::METADATA) && !source.has(prepared::BODIES) {
        wild::read(source, options)
    } else {
        prepared::read(source, options)
    }
}
