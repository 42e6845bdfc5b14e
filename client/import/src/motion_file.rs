//! Motions of files, with a hint where a file is another program's and no motion.

use crate::ImportError;
use crate::motion::{self, Motion, MotionOptions};
use crate::{keypoints, tools, what};
use std::path::Path;

/// What a file of poses is good for.
const BECOMES: &str = "with its clip it becomes a capture (yoto import CLIP --poses FILE), whose poses.json is a motion";

/// As [`motion::read`]; a file that is no motion is named by what it is.
///
/// # Errors
/// Those of [`motion::read`].
pub fn read_motion(path: &Path, options: &MotionOptions) -> Result<Motion, ImportError> {
    motion::read(path, options).map_err(|error| match (error, not_a_motion(path)) {
        (ImportError::Unusable(_), Some(what)) => {
            ImportError::Unusable(format!("{}: {what}", path.display()))
        }
        (error, _) => error,
    })
}

/// What the file at `path` is, if it is known and no motion.
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
    what::of_ending(path).map(str::to_owned)
}
