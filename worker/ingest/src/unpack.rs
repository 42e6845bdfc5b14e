//! Unpacks archives of an upload into files of the capture.

use super::failure::ReadFailure;
use std::path::Path;
use yoto_media::Limits;
use yoto_media::archive::{Files, Unpacker};
use yoto_proto::media_plan::{self, ARCHIVE_ENDINGS, CAPTURE_ARCHIVES};
use yoto_proto::pose_track::{FILES, violation};

/// The plan inside an archive that was uploaded together with another plan, which takes precedence.
pub(super) const OWN_PLAN: &str = "media.json of the archive";
/// Optional folder of a capture's training frames.
const TRAIN: &str = "train/";

/// The capture's `files` with all its top-level archives unpacked into `folder`. `capture.zip` has a whole capture, in one
/// folder or none; `frames.zip` has the content of `frames/`, and so on.
pub(super) fn unpacked(
    folder: &Path,
    uploaded: &Files,
    limits: &Limits,
) -> Result<Files, ReadFailure> {
    let folder = folder.join("unpacked");
    std::fs::create_dir_all(&folder)
        .map_err(|error| ReadFailure::Machine(format!("{}: {error}", folder.display())))?;
    let mut unpacker = Unpacker::new(&folder, limits);
    let mut files = Files::new();
    for (name, path) in uploaded {
        let Some(stem) = stem(name) else {
            add(&mut files, name, name.clone(), path.clone())?;
            continue;
        };
        let inside = unpacker
            .unpack(path)
            .map_err(|error| ReadFailure::at(error, name, None))?;
        let whole = CAPTURE_ARCHIVES.contains(&name.as_str());
        let base = if whole {
            base(&inside).to_owned()
        } else {
            format!("{stem}/")
        };
        for (entry, path) in inside {
            let own_plan = whole && entry.strip_prefix(&base) == Some(media_plan::FILE);
            let entry = if own_plan && uploaded.contains_key(media_plan::FILE) {
                format!("{base}{OWN_PLAN}")
            } else {
                entry
            };
            let to = match (entry.strip_prefix(&base), whole) {
                (Some(rest), true) => rest.to_owned(),
                (None, true) => continue,
                (Some(_), false) => entry,
                (None, false) => format!("{base}{entry}"),
            };
            add(&mut files, name, to, path)?;
        }
    }
    Ok(without_train(files))
}

fn add(
    files: &mut Files,
    archive: &str,
    name: String,
    path: std::path::PathBuf,
) -> Result<(), ReadFailure> {
    if files.insert(name.clone(), path).is_some() {
        let message = "the capture has another file of this name";
        let fault = violation("DUPLICATE", archive, None, name, message);
        return Err(ReadFailure::of(fault));
    }
    Ok(())
}

/// The name of a top-level archive without its extension.
fn stem(name: &str) -> Option<&str> {
    let ending = ARCHIVE_ENDINGS.iter().find(|it| name.ends_with(**it))?;
    let stem = name.strip_suffix(ending)?;
    (!stem.is_empty() && !stem.contains('/')).then_some(stem)
}

/// The folder, with its slash, of the least nested pose track.
fn base(files: &Files) -> &str {
    let track = |name| {
        FILES
            .into_iter()
            .find_map(|file| str::strip_suffix(name, file))
    };
    let tracks = files.keys().map(String::as_str).filter_map(track);
    let folders = tracks.filter(|it| it.is_empty() || it.ends_with('/'));
    folders.min_by_key(|it| it.len()).unwrap_or_default()
}

/// Removes `train/` from the names, unless the capture has its frames at the top level.
fn without_train(files: Files) -> Files {
    let top = |name: &String| name.starts_with("frames/") || name.starts_with("video.");
    if files.keys().any(top) {
        return files;
    }
    let names: Vec<String> = files.keys().cloned().collect();
    let mut out = files;
    for name in names {
        if let Some(rest) = name.strip_prefix(TRAIN)
            && !out.contains_key(rest)
            && let Some(path) = out.remove(&name)
        {
            out.insert(rest.to_owned(), path);
        }
    }
    out
}
