//! Imports a film that a service got without poses, as `yoto import` does, in the process that reads uploads.

use crate::{ImportError, Options, Progress, ProgressEvent, TrackForm, film, write};
use std::path::Path;
use yoto_ingest::{Files, Film, FilmCapture, ReadFailure, Tell};
use yoto_landmarks::PoseModel;

/// Finds poses and masks of the person in `given`, and writes a capture. It is a [`FilmReader`](yoto_ingest::FilmReader).
///
/// # Errors
/// Faults of the film by the name that it was uploaded with, and of this machine.
pub fn read_film(given: &Film<'_>, tell: Tell) -> Result<FilmCapture, ReadFailure> {
    let options = Options {
        pose_model: Some(given.pose_model.to_owned()),
        ffmpeg: given.ffmpeg.map(Path::to_owned),
        progress: Progress::to(move |event| {
            if let ProgressEvent::Counted { done, total, .. } = event {
                tell(done, total);
            }
        }),
        ..Options::default()
    };
    let mut imported = film::read(given.path, &options).map_err(|error| failure(error, given))?;
    let written = write(&imported, &given.folder, TrackForm::Binary, |_, _, _| {});
    written.map_err(|error| failure(error, given))?;
    let mut files = Files::new();
    listed(&given.folder, "", &mut files).map_err(|error| {
        let folder = given.folder.display();
        ReadFailure::Machine(format!("{folder}: {error}"))
    })?;
    let doubts = std::mem::take(&mut imported.found.doubts);
    imported.notes.retain(|note| !doubts.contains(note));
    Ok(FilmCapture {
        files,
        notes: imported.notes,
        warnings: doubts,
    })
}

/// Checks that `path`, a file or a folder, has a pose model that can be read.
///
/// # Errors
/// When the path has no pose model, or it can't be read.
pub fn check_pose_model(path: &Path) -> Result<(), ImportError> {
    let opened = PoseModel::open(path).map(drop);
    opened.map_err(|error| crate::clip::fault(path, "POSE_MODEL", error.to_string()))
}

/// Adds all files below `folder`, which is `inside` of the capture.
fn listed(folder: &Path, inside: &str, files: &mut Files) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let name = format!("{inside}{}", entry.file_name().to_string_lossy());
        match entry.file_type()?.is_dir() {
            true => listed(&entry.path(), &format!("{name}/"), files)?,
            false => drop(files.insert(name, entry.path())),
        }
    }
    Ok(())
}

fn failure(error: ImportError, film: &Film<'_>) -> ReadFailure {
    match error {
        ImportError::BadCapture { violations, .. } => {
            let named = violations.into_iter().map(|mut fault| {
                film.name.clone_into(&mut fault.file);
                fault
            });
            ReadFailure::Rejected(named.collect())
        }
        other => {
            let causes =
                std::iter::successors(Some(&other as &dyn std::error::Error), |it| it.source());
            let words: Vec<String> = causes.map(ToString::to_string).collect();
            ReadFailure::Machine(words.join(": "))
        }
    }
}
