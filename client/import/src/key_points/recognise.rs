//! Which detector wrote a file or a folder, by their contents.

use super::detections::Detections;
use super::{
    alphapose, easy_vitpose, mediapipe, mediapipe_json, mediapipe_table, mmpose, openpose,
    sam_3d_body,
};
use crate::source::{Part, Source};
use std::path::Path;
use yoto_client::ClientError;

/// Endings of files that hold a whole clip's key points, the likeliest first.
const ENDINGS: [&str; 3] = [".json", ".npz", ".csv"];
/// Files of a folder that are tried.
const TRIED: usize = 8;

/// Which files they are.
#[derive(Clone, Copy, Debug)]
enum Kind {
    OpenPose,
    AlphaPose,
    MmPose,
    EasyVitPose,
    MediaPipe,
    MediaPipeJson,
    MediaPipeTable,
    Sam3dBody,
}

/// The contents of the file or folder at `path`, of pictures of `size`.
///
/// # Errors
/// When no detector's files are there; when a file is recognised but wrong.
pub(super) fn read(path: &Path, size: [u32; 2]) -> Result<Detections, ClientError> {
    let (source, name) = place(path);
    let Some((kind, file)) = find(&source, &name)? else {
        let message = format!("no detector's files; looked for {}", super::FILES);
        return Err(source.fault("UNKNOWN", &name, None, "", message));
    };
    match kind {
        Kind::OpenPose => openpose::read(&source),
        Kind::Sam3dBody => sam_3d_body::read(&source, size),
        Kind::MediaPipeTable => mediapipe_table::read(&source, &file, size),
        Kind::AlphaPose | Kind::MmPose | Kind::EasyVitPose => {
            let data = source.data(&file, None)?;
            match kind {
                Kind::AlphaPose => alphapose::read(&data.root()),
                Kind::MmPose => mmpose::read(&data.root()),
                _ => easy_vitpose::read(&data.root()),
            }
        }
        Kind::MediaPipe => mediapipe::read(&source.data(&file, None)?.root(), size),
        Kind::MediaPipeJson => mediapipe_json::read(&source.data(&file, None)?.root(), size),
    }
}

/// Whether the file or folder at `path` holds a detector's files.
pub(crate) fn has_files(path: &Path) -> bool {
    let (source, name) = place(path);
    matches!(find(&source, &name), Ok(Some(_)))
}

/// A folder and no name, or a file's folder and its name.
fn place(path: &Path) -> (Source, String) {
    if path.is_dir() {
        return (Source::new(path), String::new());
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let folder = path.parent().unwrap_or(Path::new(""));
    (Source::new(folder), name.into_owned())
}

/// The file called `name`, or the first of the folder that a detector wrote.
fn find(source: &Source, name: &str) -> Result<Option<(Kind, String)>, ClientError> {
    if !name.is_empty() {
        let kind = kind(source, name)?;
        return Ok(kind.map(|kind| (kind, name.to_owned())));
    }
    if !source.list("", &[openpose::ENDING])?.is_empty() {
        return Ok(Some((Kind::OpenPose, String::new())));
    }
    for ending in ENDINGS {
        for file in source.list("", &[ending])?.iter().take(TRIED) {
            let file = file.trim_start_matches('/');
            if let Some(kind) = kind(source, file)? {
                return Ok(Some((kind, file.to_owned())));
            }
        }
    }
    Ok(None)
}

/// What `file` is; `None` when it is no detector's.
fn kind(source: &Source, file: &str) -> Result<Option<Kind>, ClientError> {
    let lower = file.to_ascii_lowercase();
    if lower.ends_with(openpose::ENDING) {
        return Ok(Some(Kind::OpenPose));
    }
    if lower.ends_with(".csv") {
        let is_table = mediapipe_table::fits(source, file)?;
        return Ok(is_table.then_some(Kind::MediaPipeTable));
    }
    if !ENDINGS.iter().any(|ending| lower.ends_with(ending)) {
        return Ok(None);
    }
    type Fits = fn(&Part<'_>) -> bool;
    const KINDS: [(Fits, Kind); 6] = [
        (alphapose::fits, Kind::AlphaPose),
        (mmpose::fits, Kind::MmPose),
        (easy_vitpose::fits, Kind::EasyVitPose),
        (mediapipe::fits, Kind::MediaPipe),
        (mediapipe_json::fits, Kind::MediaPipeJson),
        (sam_3d_body::fits, Kind::Sam3dBody),
    ];
    let data = source.data(file, None)?;
    let root = data.root();
    let found = KINDS.iter().find(|(fits, _)| fits(&root));
    Ok(found.map(|(_, kind)| *kind))
}
