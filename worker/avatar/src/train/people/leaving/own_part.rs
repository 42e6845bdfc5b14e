//! The part of a checkpoint that one person owns, to hand it to them.

use crate::identity::own::owner;
use crate::train::TrainError;
use safetensors::SafeTensors;
use yoto_proto::manifest::files;

/// The parameters of the person in `slot` from the `weights` of a checkpoint, in the same format. Parameters that people
/// share are left out.
///
/// # Errors
/// If `weights` is not such a file, or nothing in it is theirs.
pub fn own_part(weights: &[u8], slot: usize) -> Result<Vec<u8>, TrainError> {
    let failed = |message: String| TrainError::File {
        file: files::WEIGHTS.to_owned(),
        message,
    };
    let all = SafeTensors::deserialize(weights).map_err(|error| failed(error.to_string()))?;
    let own = all.tensors().into_iter();
    let own: Vec<_> = own.filter(|(name, _)| owner(name) == Some(slot)).collect();
    if own.is_empty() {
        return Err(failed(format!("nothing in it is of slot {slot}")));
    }
    safetensors::serialize(own, None).map_err(|error| failed(error.to_string()))
}
