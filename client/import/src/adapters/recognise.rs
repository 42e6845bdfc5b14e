//! Recognises the format of a file or folder.

use super::table::{Adapter, RecognisedBy, adapters};
use crate::clip::{PICTURES, fault, is_video, listed};
use crate::{ImportError, Options, keypoints, tools};
use std::path::Path;
use yoto_proto::pose_track::violation;

/// What was recognised.
pub(super) enum Recognised {
    /// One format, and its name in a note.
    Format(&'static Adapter, Option<&'static str>),
    /// A pose tool's files. Only their contents tell the tool, see [`tools::open`].
    Tool,
}

/// The format of what is in `dir`, with `options`.
///
/// # Errors
/// When nothing is recognised, with what was looked for.
pub(super) fn recognise(dir: &Path, options: &Options) -> Result<Recognised, ImportError> {
    std::fs::metadata(dir).map_err(ImportError::file("reading", dir))?;
    for adapter in adapters() {
        match adapter.fits {
            RecognisedBy::Files(alternatives) => {
                let mut alternatives = alternatives.iter();
                let all = |files: &[&str]| files.iter().all(|file| dir.join(file).exists());
                if let Some((name, _)) = alternatives.find(|(_, files)| all(files)) {
                    return Ok(Recognised::Format(adapter, Some(name)));
                }
            }
            RecognisedBy::Poses(name, fits) => {
                if options.poses.as_deref().is_some_and(fits) {
                    return Ok(Recognised::Format(adapter, name));
                }
            }
            RecognisedBy::Tool => {
                if options.poses.is_some() || (dir.is_dir() && tools::has_files(dir)) {
                    return Ok(Recognised::Tool);
                }
            }
            RecognisedBy::Clip => {
                let has_pictures = || listed(dir, &PICTURES).is_ok_and(|files| !files.is_empty());
                if is_video(dir) || (dir.is_dir() && has_pictures()) {
                    return Ok(Recognised::Format(adapter, Some("a clip alone")));
                }
            }
        }
    }
    Err(unknown(dir))
}

/// The error about a file or folder that no format fits.
fn unknown(dir: &Path) -> ImportError {
    let name = dir.file_name().unwrap_or_default().to_string_lossy();
    if dir.is_file() && name.to_ascii_lowercase().ends_with(".hdf5") {
        let message =
            "is one of PeopleSnapshot's files, which are imported together: name their folder";
        return fault(dir, "UNKNOWN", message);
    }
    if dir.is_file() {
        let message = format!(
            "is not a video by its first bytes. What a pose tool or a detector of points wrote goes with its \
             clip: yoto import CLIP --poses {}",
            dir.display()
        );
        return fault(dir, "UNKNOWN", message);
    }
    let alternatives = adapters().iter().filter_map(|adapter| match adapter.fits {
        RecognisedBy::Files(alternatives) => Some(alternatives),
        _ => None,
    });
    let captures: Vec<String> = alternatives
        .flatten()
        .map(|(name, files)| format!("{name} ({})", files.join(", ")))
        .collect();
    let tools = tools::ALL.map(|tool| tool.documented.tool);
    let message = format!(
        "of no format that is known; looked for a video or pictures, {}, and, with --poses, the files of {}, \
         BVH, or key points of {}",
        captures.join(", "),
        tools.join(", "),
        keypoints::looked_for()
    );
    ImportError::BadCapture {
        place: dir.display().to_string(),
        violations: vec![violation("UNKNOWN", &name, None, "", message)],
    }
}
