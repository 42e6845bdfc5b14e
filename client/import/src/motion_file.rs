//! Reads motions, with a hint where a file has no motion but another program's data.

use crate::motion::{self, Motion, MotionOptions};
use crate::{ImportError, keypoints, misplaced, tools};
use std::path::Path;

/// The use of a file of poses.
const BECOMES: &str = "with its clip it becomes a capture (yoto import CLIP --poses FILE), whose poses.json is a motion";

/// Reads a motion as [`motion::read`] does. The error about a file of another kind says what the file is.
///
/// # Errors
/// The same errors as [`motion::read`].
pub fn read_motion(path: &Path, options: &MotionOptions) -> Result<Motion, ImportError> {
    motion::read(path, options).map_err(|error| match (error, not_a_motion(path)) {
        (ImportError::Unusable(_), Some(what)) => {
            ImportError::Unusable(format!("{}: {what}", path.display()))
        }
        (error, _) => error,
    })
}

/// The kind of the file at `path`, if it is known and not a motion.
fn not_a_motion(path: &Path) -> Option<String> {
    if !path.is_file() || tools::bvh_clip::fits(path) {
        return None;
    }
    if let Some(tool) = tools::wrote(path) {
        return Some(format!("this is what {tool} wrote: {BECOMES}"));
    }
    if keypoints::has_files(path) {
        return Some(format!("these are key points: {BECOMES}"));
    }
    misplaced::of_ending(path).map(str::to_owned)
}
