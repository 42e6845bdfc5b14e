//! The refined poses of a checkpoint: changes, for a training that goes on, and pose tracks, for
//! renders.

use crate::train::poses::refinement::PoseRefinement;
use crate::train::{TrainError, TrainPerson};
use std::path::Path;
use yoto_proto::manifest::files;
use yoto_proto::pose_track::{PoseTrack, describe};

fn failed(path: &Path, error: impl std::fmt::Display) -> TrainError {
    TrainError::File {
        file: path.display().to_string(),
        message: error.to_string(),
    }
}

/// Writes the refined poses of every slot into `dir`, if there are any.
pub(crate) fn save(dir: &Path, poses: &[Option<PoseRefinement>]) -> Result<(), TrainError> {
    if poses.iter().all(Option::is_none) {
        return Ok(());
    }
    let path = dir.join(files::REFINEMENT);
    let json = serde_json::to_vec(poses).map_err(|e| failed(&path, e))?;
    std::fs::write(&path, json).map_err(|e| failed(&path, e))
}

/// Writes the refined `track` of the person in `slot` into `dir`, for programs.
pub(crate) fn save_track(dir: &Path, slot: usize, track: &PoseTrack) -> Result<(), TrainError> {
    let path = dir.join(files::refined_poses(slot));
    std::fs::write(&path, track.to_binary()).map_err(|e| failed(&path, e))
}

/// Slots and files of the refined tracks in `dir` of those who are not among the `people`.
pub(crate) fn others(
    dir: &Path,
    people: &[TrainPerson],
) -> Result<Vec<(usize, Vec<u8>)>, TrainError> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(dir).map_err(|e| failed(dir, e))? {
        let path = entry.map_err(|e| failed(dir, e))?.path();
        let slot = path
            .file_name()
            .and_then(|name| files::refined_by(name.to_str()?));
        let Some(slot) = slot.filter(|slot| people.iter().all(|it| it.slot != *slot)) else {
            continue;
        };
        found.push((slot, std::fs::read(&path).map_err(|e| failed(&path, e))?));
    }
    found.sort_unstable();
    Ok(found)
}

/// Writes the `file` of the refined track of the person in `slot` into `dir`, as [`others`] gave it.
pub(crate) fn keep(dir: &Path, slot: usize, file: &[u8]) -> Result<(), TrainError> {
    let path = dir.join(files::refined_poses(slot));
    std::fs::write(&path, file).map_err(|e| failed(&path, e))
}

/// The refined poses of each slot of a checkpoint in `dir`; none where nobody's poses were refined. The skeleton of a slot has as many
/// `joints`, where that is known.
pub(crate) fn load(
    dir: &Path,
    joints: impl Fn(usize) -> Option<usize>,
) -> Result<Vec<Option<PoseRefinement>>, TrainError> {
    let path = dir.join(files::REFINEMENT);
    if !path.exists() {
        return Ok(Vec::new());
    }
    let bytes = std::fs::read(&path).map_err(|e| failed(&path, e))?;
    let poses: Vec<Option<PoseRefinement>> =
        serde_json::from_slice(&bytes).map_err(|e| failed(&path, e))?;
    for (slot, poses) in poses.iter().enumerate() {
        let (Some(poses), Some(joints)) = (poses, joints(slot)) else {
            continue;
        };
        if !poses.fits(joints) {
            return Err(failed(
                &path,
                format!("slot {slot}: its changes are not of a skeleton with {joints} joints"),
            ));
        }
    }
    Ok(poses)
}

/// The pose track `given` of the person in `slot` as the training of the checkpoint in `dir` refined
/// it; `None` if it refined nobody's poses there, or those of another film.
///
/// # Errors
/// A file that can't be read.
pub fn refined_track(
    dir: &Path,
    slot: usize,
    given: &PoseTrack,
) -> Result<Option<PoseTrack>, TrainError> {
    let known = load(dir, |it| (it == slot).then(|| given.joints()))?;
    let of_this_film = |it: &PoseRefinement| it.is_of(given);
    if !known
        .get(slot)
        .and_then(Option::as_ref)
        .is_some_and(of_this_film)
    {
        return Ok(None);
    }
    let path = dir.join(files::refined_poses(slot));
    let bytes = std::fs::read(&path).map_err(|e| failed(&path, e))?;
    let track = PoseTrack::from_binary(&bytes).map_err(|found| {
        let found: Vec<String> = found.iter().map(describe).collect();
        failed(&path, found.join("; "))
    })?;
    Ok(Some(track))
}
