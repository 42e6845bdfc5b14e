//! Recognises the detector that wrote a file or a folder, by the contents.

use super::detections::Detections;
use super::form::{DetectorFile, DetectorForm, RecognisedBy};
use super::point_set::PointSet;
use super::{
    alphapose, easy_vitpose, mediapipe, mediapipe_json, mediapipe_table, mmpose, openpose,
    point_table, sam_3d_body, shapes,
};
use crate::ImportError;
use crate::misplaced::unknown;
use crate::source::Source;
use std::path::Path;
use std::sync::LazyLock;

/// Endings of files that hold a whole clip's key points, the likeliest first.
const ENDINGS: [&str; 7] = [".json", ".npz", ".csv", ".npy", ".pkl", ".pickle", ".pt"];
/// At most this number of a folder's files is tried for each ending.
const TRIED: usize = 8;

/// All forms, in the order in which a file is tried.
static FORMS: [&DetectorForm; 10] = [
    &openpose::FORM,
    &mediapipe_table::FORM,
    &alphapose::FORM,
    &mmpose::FORM,
    &easy_vitpose::FORM,
    &mediapipe::FORM,
    &mediapipe_json::FORM,
    &sam_3d_body::FORM,
    &point_table::FORM,
    &shapes::FORM,
];

/// The names of all detectors of key points.
pub fn key_point_detectors() -> impl Iterator<Item = &'static str> {
    FORMS.iter().filter_map(|form| form.detector)
}

/// The detectors, for people: `OpenPose, … or SAM 3D Body`.
fn detectors() -> String {
    let names: Vec<&str> = key_point_detectors().collect();
    match names.split_last() {
        Some((last, others)) if !others.is_empty() => format!("{} or {last}", others.join(", ")),
        _ => names.concat(),
    }
}

/// What `--help` says of the format.
pub(crate) fn help() -> &'static str {
    static HELP: LazyLock<String> = LazyLock::new(|| {
        let names = detectors();
        format!(
            "Key points of {names}: --poses their files, with the clip; a body is fitted to them"
        )
    });
    &HELP
}

/// The files that [`has_files`] finds, for errors.
pub(crate) fn looked_for() -> String {
    format!(
        "{}, or points of 17, 25, 26 or 33 as [frames, points, 2 or 3]",
        detectors()
    )
}

/// The contents of the file or folder at `path`, of pictures of `size`.
///
/// # Errors
/// When no detector's files are there; when a file is recognised but wrong.
pub(super) fn read(
    path: &Path,
    points: Option<PointSet>,
    size: [u32; 2],
) -> Result<Detections, ImportError> {
    let (source, given) = located(path);
    let Some((form, name)) = find(&source, &given)? else {
        return Err(unknown(path, &format!("key points of {}", looked_for())));
    };
    let mut found = (form.read)(&DetectorFile {
        source: &source,
        name: &name,
        given: Some(&*given).filter(|given| !given.is_empty()),
        points,
        size,
    })?;
    found.sieve();
    Ok(found)
}

/// Whether the file or folder at `path` holds a detector's files.
pub(crate) fn has_files(path: &Path) -> bool {
    let (source, name) = located(path);
    matches!(find(&source, &name), Ok(Some(_)))
}

/// A folder and no name, or a file's folder and its name.
fn located(path: &Path) -> (Source, String) {
    if path.is_dir() {
        return (Source::new(path), String::new());
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let folder = path.parent().unwrap_or(Path::new(""));
    (Source::new(folder), name.into_owned())
}

/// The file called `name`, or the first of the folder that a detector wrote.
fn find(
    source: &Source,
    name: &str,
) -> Result<Option<(&'static DetectorForm, String)>, ImportError> {
    if !name.is_empty() {
        let form = form(source, name)?;
        return Ok(form.map(|form| (form, name.to_owned())));
    }
    let openpose = source.list("", &[openpose::ENDING])?;
    let mut candidates: Vec<String> = openpose.into_iter().take(1).collect();
    for ending in ENDINGS {
        candidates.extend(source.list("", &[ending])?.into_iter().take(TRIED));
    }
    for file in candidates {
        let file = file.trim_start_matches('/');
        if let Some(form) = form(source, file)? {
            return Ok(Some((form, file.to_owned())));
        }
    }
    Ok(None)
}

/// The form of `file`; `None` when no detector wrote it.
fn form(source: &Source, file: &str) -> Result<Option<&'static DetectorForm>, ImportError> {
    let lower = file.to_ascii_lowercase();
    let is_table = lower.ends_with(".csv");
    let has_contents = !is_table && ENDINGS.iter().any(|ending| lower.ends_with(ending));
    let mut data = None;
    for form in FORMS {
        let fits = match form.fits {
            RecognisedBy::Ending(ending) => lower.ends_with(ending),
            RecognisedBy::Table(fits) => is_table && fits(source, file)?,
            RecognisedBy::Contents(_) if !has_contents => false,
            RecognisedBy::Contents(fits) => {
                if data.is_none() {
                    data = Some(source.data(file, None)?);
                }
                data.as_ref().is_some_and(|data| fits(&data.root()))
            }
        };
        if fits {
            return Ok(Some(form));
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::detectors;

    #[test]
    fn detectors_are_named_once_and_in_order() {
        let expected = "OpenPose, AlphaPose, MMPose, easy_ViTPose, MediaPipe or SAM 3D Body";
        assert_eq!(detectors(), expected);
    }
}
