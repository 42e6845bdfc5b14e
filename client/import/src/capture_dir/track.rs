//! The motion of a capture's folder: its pose track alone.

use std::path::Path;
use yoto_client::ClientError;
use yoto_proto::pose_track::{FILE, PoseTrack};

/// The pose track of the capture in `dir`.
///
/// # Errors
/// [`ClientError::File`] when it can't be read; [`ClientError::BadCapture`] with all of its faults.
pub fn read_track(dir: &Path) -> Result<PoseTrack, ClientError> {
    let path = dir.join(FILE);
    let bytes = std::fs::read(&path).map_err(ClientError::file("reading", &path))?;
    PoseTrack::from_json(&bytes).map_err(|violations| ClientError::BadCapture {
        place: dir.display().to_string(),
        violations,
    })
}

/// What the capture in `dir` is called: its last folder.
pub fn named(dir: &Path) -> String {
    let name = dir.file_name().unwrap_or(dir.as_os_str());
    name.to_string_lossy().into_owned()
}
