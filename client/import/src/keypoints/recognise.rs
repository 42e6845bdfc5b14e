//! Which detector wrote a file or a folder, by their contents.

use super::detections::Detections;
use super::point_set::PointSet;
use super::{
    alphapose, easy_vitpose, mediapipe, mediapipe_json, mediapipe_table, mmpose, openpose,
    point_table, sam_3d_body, shapes,
};
use crate::source::{Data, Part, Source};
use crate::what::unknown;
use std::path::Path;
use yoto_client::ClientError;

/// Endings of files that hold a whole clip's key points, the likeliest first.
const ENDINGS: [&str; 7] = [".json", ".npz", ".csv", ".npy", ".pkl", ".pickle", ".pt"];
/// Files of a folder that are tried.
const TRIED: usize = 8;

/// A file of a detector, or one of a folder of them.
struct DetectorFile<'a> {
    source: &'a Source,
    name: &'a str,
    /// The name that the user gave, if it was not a folder's.
    given: Option<&'a str>,
    /// The set of the points, if the user says.
    points: Option<PointSet>,
    /// Width and height of the clip, pixels.
    size: [u32; 2],
}

/// How a file is recognised.
enum Fits {
    /// By the end of its name.
    Ending(&'static str),
    /// By the first line of a `.csv`.
    Table(fn(&Source, &str) -> Result<bool, ClientError>),
    /// By what is in a `.json` or `.npz`.
    Contents(fn(&Part<'_>) -> bool),
}

/// A form in which detectors write key points.
struct Form {
    fits: Fits,
    read: fn(&DetectorFile<'_>) -> Result<Detections, ClientError>,
}

impl DetectorFile<'_> {
    fn data(&self) -> Result<Data<'_>, ClientError> {
        self.source.data(self.name, None)
    }
}

/// All forms, in the order in which a file is tried.
static FORMS: [Form; 10] = [
    Form {
        fits: Fits::Ending(openpose::ENDING),
        read: |file| openpose::read(file.source),
    },
    Form {
        fits: Fits::Table(mediapipe_table::fits),
        read: |file| mediapipe_table::read(file.source, file.name, file.size),
    },
    Form {
        fits: Fits::Contents(alphapose::fits),
        read: |file| alphapose::read(&file.data()?.root()),
    },
    Form {
        fits: Fits::Contents(mmpose::fits),
        read: |file| mmpose::read(&file.data()?.root()),
    },
    Form {
        fits: Fits::Contents(easy_vitpose::fits),
        read: |file| easy_vitpose::read(&file.data()?.root()),
    },
    Form {
        fits: Fits::Contents(mediapipe::fits),
        read: |file| mediapipe::read(&file.data()?.root(), file.size),
    },
    Form {
        fits: Fits::Contents(mediapipe_json::fits),
        read: |file| mediapipe_json::read(&file.data()?.root(), file.size),
    },
    Form {
        fits: Fits::Contents(sam_3d_body::fits),
        read: |file| sam_3d_body::read(file.source, file.given, file.size),
    },
    Form {
        fits: Fits::Table(point_table::fits),
        read: |file| point_table::read(file.source, file.name, file.points, file.size),
    },
    Form {
        fits: Fits::Contents(shapes::fits),
        read: |file| shapes::read(&file.data()?.root(), file.points, file.size),
    },
];

/// The contents of the file or folder at `path`, of pictures of `size`.
///
/// # Errors
/// When no detector's files are there; when a file is recognised but wrong.
pub(super) fn read(
    path: &Path,
    points: Option<PointSet>,
    size: [u32; 2],
) -> Result<Detections, ClientError> {
    let (source, given) = located(path);
    let Some((form, name)) = find(&source, &given)? else {
        return Err(unknown(
            path,
            &format!("key points of {}", super::DETECTORS),
        ));
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
fn find(source: &Source, name: &str) -> Result<Option<(&'static Form, String)>, ClientError> {
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

/// The form of `file`; `None` when it is no detector's.
fn form(source: &Source, file: &str) -> Result<Option<&'static Form>, ClientError> {
    let lower = file.to_ascii_lowercase();
    let is_table = lower.ends_with(".csv");
    let has_contents = !is_table && ENDINGS.iter().any(|ending| lower.ends_with(ending));
    let mut data = None;
    for form in &FORMS {
        let fits = match form.fits {
            Fits::Ending(ending) => lower.ends_with(ending),
            Fits::Table(fits) => is_table && fits(source, file)?,
            Fits::Contents(_) if !has_contents => false,
            Fits::Contents(fits) => {
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
