//! The motion of a capture's folder: its pose track alone.

use crate::ImportError;
use std::path::Path;
use yoto_proto::pose_track::{FILE, PoseTrack};

/// The pose track of the capture in `dir`.
///
/// # Errors
/// [`ImportError::File`] when it can't be read; [`ImportError::BadCapture`] with all of its faults.
pub fn read_track(dir: &Path) -> Result<PoseTrack, ImportError> {
    let path = dir.join(FILE);
    let bytes = std::fs::read(&path).map_err(ImportError::file("reading", &path))?;
    PoseTrack::from_json(&bytes).map_err(|violations| ImportError::BadCapture {
        place: dir.display().to_string(),
        violations,
    })
}

/// The name of the capture in `dir`: its last folder.
pub fn named(dir: &Path) -> String {
    let name = dir.file_name().unwrap_or(dir.as_os_str());
    name.to_string_lossy().into_owned()
}
