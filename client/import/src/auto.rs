//! Recognises the format of a capture by its files.

use super::clip::{PICTURES, fault, is_video, listed};
use super::{Format, Options, bvh_clip, key_points, pose_tools};
use std::path::Path;
use yoto_client::ClientError;
use yoto_proto::pose_track::{FILES, violation};

/// Formats with the files that tell them, of which all must be there.
const MARKS: [(Format, &[&str], &str); 6] = [
    (Format::Zju, &["annots.npy"], "ZJU-MoCap"),
    (
        Format::HumanNerf,
        &["mesh_infos.pkl"],
        "HumanNeRF's prepared capture",
    ),
    (
        Format::HumanNerf,
        &["metadata.json", "images"],
        "HumanNeRF's wild video",
    ),
    (
        Format::PeopleSnapshot,
        &["reconstructed_poses.hdf5", "camera.pkl"],
        "PeopleSnapshot",
    ),
    (
        Format::InstantAvatar,
        &["cameras.npz", "poses.npz"],
        "InstantAvatar",
    ),
    (
        Format::InstantAvatar,
        &["cameras.npz", "poses"],
        "InstantAvatar",
    ),
];

/// What was recognised.
pub(super) enum Recognised {
    /// A capture of another program, and its name.
    Capture(Format, &'static str),
    /// Key points of a detector.
    KeyPoints,
    /// A pose tool's files, which say themselves what they are.
    PoseTool,
}

/// The format of what is in `dir`, with `options`.
///
/// # Errors
/// When nothing is recognised, with what was looked for.
pub(super) fn recognise(dir: &Path, options: &Options) -> Result<Recognised, ClientError> {
    std::fs::metadata(dir).map_err(ClientError::file("reading", dir))?;
    if FILES.iter().any(|name| dir.join(name).is_file()) {
        return Ok(Recognised::Capture(Format::Folder, "a capture folder"));
    }
    let mut marks = MARKS.iter();
    let found = marks.find(|(_, files, _)| files.iter().all(|file| dir.join(file).exists()));
    if let Some((format, _, name)) = found {
        return Ok(Recognised::Capture(*format, name));
    }
    if options.poses.as_deref().is_some_and(bvh_clip::fits) {
        return Ok(Recognised::Capture(Format::Bvh, "BVH"));
    }
    if options.poses.as_deref().is_some_and(key_points::has_files) {
        return Ok(Recognised::KeyPoints);
    }
    if options.poses.is_some() || (dir.is_dir() && pose_tools::has_files(dir)) {
        return Ok(Recognised::PoseTool);
    }
    let has_pictures = || listed(dir, &PICTURES).is_ok_and(|files| !files.is_empty());
    if is_video(dir) || (dir.is_dir() && has_pictures()) {
        return Ok(Recognised::Capture(Format::Film, "a clip alone"));
    }
    if dir.is_file() {
        let message = format!(
            "is no video by its first bytes. What a pose tool or a detector of points wrote goes with its \
             clip: yoto import CLIP --poses {}",
            dir.display()
        );
        return Err(fault(dir, "UNKNOWN", message));
    }
    let captures: Vec<String> = MARKS
        .iter()
        .map(|(_, files, name)| format!("{name} ({})", files.join(", ")))
        .collect();
    let tools: Vec<&str> = pose_tools::Tool::ALL
        .iter()
        .map(|tool| tool.name())
        .collect();
    let message = format!(
        "of no format that is known; looked for a video or pictures, a capture folder ({}), {}, and, with \
         --poses, the files of {}, BVH, or {}",
        FILES.join(", "),
        captures.join(", "),
        tools.join(", "),
        key_points::FILES
    );
    let name = dir.file_name().unwrap_or_default().to_string_lossy();
    Err(ClientError::BadCapture {
        place: dir.display().to_string(),
        violations: vec![violation("UNKNOWN", &name, None, "", message)],
    })
}
