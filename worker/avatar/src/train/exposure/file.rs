//! The exposures of a checkpoint, for a training that goes on, and for measurements on frames of the same film.

use super::CaptureExposures;
use crate::train::TrainError;
use std::path::Path;
use yoto_proto::manifest::files;
use yoto_proto::pose_track::PoseTrack;

fn failed(path: &Path, error: impl std::fmt::Display) -> TrainError {
    TrainError::File {
        file: path.display().to_string(),
        message: error.to_string(),
    }
}

/// Writes the exposures of every slot into `dir`, if there are any.
pub(in crate::train) fn save(
    dir: &Path,
    all: &[Option<CaptureExposures>],
) -> Result<(), TrainError> {
    if all.iter().all(Option::is_none) {
        return Ok(());
    }
    let path = dir.join(files::EXPOSURES);
    let json = serde_json::to_vec(all).map_err(|e| failed(&path, e))?;
    std::fs::write(&path, json).map_err(|e| failed(&path, e))
}

/// The exposures of each slot of a checkpoint in `dir`; none where nobody's were learned.
pub(in crate::train) fn load(dir: &Path) -> Result<Vec<Option<CaptureExposures>>, TrainError> {
    let path = dir.join(files::EXPOSURES);
    if !path.exists() {
        return Ok(Vec::new());
    }
    let bytes = std::fs::read(&path).map_err(|e| failed(&path, e))?;
    let all: Vec<Option<CaptureExposures>> =
        serde_json::from_slice(&bytes).map_err(|e| failed(&path, e))?;
    for (slot, exposures) in all.iter().enumerate() {
        if exposures
            .as_ref()
            .is_some_and(|exposures| !exposures.are_valid())
        {
            return Err(failed(
                &path,
                format!("slot {slot}: a gain is not above 0, or a number is not finite"),
            ));
        }
    }
    Ok(all)
}

/// The exposures of the film with `track` of the person in `slot`, as the training of the checkpoint in `dir`
/// learned them; `None` where it did not, or learned those of another film.
///
/// # Errors
/// A file that can't be read.
pub fn capture_exposures(
    dir: &Path,
    slot: usize,
    track: &PoseTrack,
) -> Result<Option<CaptureExposures>, TrainError> {
    let exposures = load(dir)?.into_iter().nth(slot).flatten();
    Ok(exposures.filter(|exposures| exposures.is_of(track)))
}
