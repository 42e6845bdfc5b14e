//! The refined poses of a checkpoint, which only a training that goes on needs.

use super::TrainError;
use super::refinement::PoseRefinement;
use std::path::Path;
use yoto_proto::manifest::files;
use yoto_proto::pose_track::PoseTrack;

fn failed(path: &Path, error: impl std::fmt::Display) -> TrainError {
    TrainError::File {
        file: path.display().to_string(),
        message: error.to_string(),
    }
}

/// Writes the refined poses of every slot into `dir`, if there are any.
pub(super) fn save(dir: &Path, poses: &[Option<PoseRefinement>]) -> Result<(), TrainError> {
    if poses.iter().all(Option::is_none) {
        return Ok(());
    }
    let path = dir.join(files::REFINEMENT);
    let json = serde_json::to_vec(poses).map_err(|e| failed(&path, e))?;
    std::fs::write(&path, json).map_err(|e| failed(&path, e))
}

/// Writes the refined `track` of the person in `slot` into `dir`, for programs.
pub(super) fn save_track(dir: &Path, slot: usize, track: &PoseTrack) -> Result<(), TrainError> {
    let path = dir.join(files::refined_poses(slot));
    std::fs::write(&path, track.to_binary()).map_err(|e| failed(&path, e))
}

/// The refined poses of each slot of a checkpoint in `dir`, for skeletons with `joints` joints; none
/// where nobody's poses were refined.
pub(super) fn load(dir: &Path, joints: usize) -> Result<Vec<Option<PoseRefinement>>, TrainError> {
    let path = dir.join(files::REFINEMENT);
    if !path.exists() {
        return Ok(Vec::new());
    }
    let bytes = std::fs::read(&path).map_err(|e| failed(&path, e))?;
    let poses: Vec<Option<PoseRefinement>> =
        serde_json::from_slice(&bytes).map_err(|e| failed(&path, e))?;
    for (slot, poses) in poses.iter().enumerate() {
        if poses.as_ref().is_some_and(|poses| !poses.fits(joints)) {
            return Err(failed(
                &path,
                format!("slot {slot}: its changes are not of a skeleton with {joints} joints"),
            ));
        }
    }
    Ok(poses)
}
