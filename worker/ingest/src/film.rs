//! A film without poses: a reader of the program finds the person, and makes a capture of the film before it is read as others are.
//!
//! This crate knows no pose model. The program that the child is gives the reader ([`FilmReader`]).

use super::failure::ReadFailure;
use super::order::{Order, Progress, Stage};
use std::fs::File;
use std::path::{Path, PathBuf};
use yoto_media::archive::Files;
use yoto_proto::media_plan::{VIDEO_ENDINGS, film_alone};
use yoto_proto::pose_track::{self, violation};

/// Makes a capture of a film. The second argument receives the numbers of pieces done and of all, of each stage anew.
pub type FilmReader = fn(&Film<'_>, Tell) -> Result<FilmCapture, ReadFailure>;

/// Receives the numbers of pieces that are done, and of all.
pub type Tell = std::sync::Arc<dyn Fn(usize, usize) + Send + Sync>;

/// A film to read.
#[derive(Debug)]
pub struct Film<'a> {
    /// The film on this disk.
    pub path: &'a Path,
    /// Its path in the upload, for faults.
    pub name: &'a str,
    /// The pose model: a file, or a folder.
    pub pose_model: &'a Path,
    /// The program for videos that are not read in-process; searched for if it has no name.
    pub ffmpeg: Option<&'a Path>,
    /// A folder that does not exist yet, for the capture.
    pub folder: PathBuf,
}

/// The capture of a film.
#[derive(Debug)]
pub struct FilmCapture {
    /// Path in the capture to path on this disk.
    pub files: Files,
    /// A summary of what was found, for people.
    pub notes: Vec<String>,
    /// What may be wrong, for people.
    pub warnings: Vec<String>,
}

/// Makes a capture of the film that `order` has, if it has one alone, in place of its files.
///
/// # Errors
/// Faults of the film, and of this machine.
pub(super) fn found(
    order: &mut Order,
    reader: Option<FilmReader>,
    tell: fn(Progress),
) -> Result<Option<FilmCapture>, ReadFailure> {
    let Some(name) = film_alone(order.files.keys().map(String::as_str)) else {
        return Ok(None);
    };
    let (Some(reader), Some(pose_model), Some(uploaded)) =
        (reader, &order.pose_model, order.files.get(name))
    else {
        let message =
            "a capture needs a pose track, and this worker has no pose model to find one in a film";
        let fault = violation("MISSING", pose_track::FILE, None, "", message);
        return Err(ReadFailure::of(fault));
    };
    // Decoders know films by their endings, and uploaded names are never used as paths on this disk.
    let ending = name
        .rsplit_once('.')
        .map(|(_, ending)| ending.to_ascii_lowercase());
    let ending = ending
        .filter(|it| VIDEO_ENDINGS.contains(&it.as_str()))
        .unwrap_or_default();
    let path = order.folder.join(format!("film.{ending}"));
    std::fs::hard_link(uploaded, &path)
        .or_else(|_| std::io::copy(&mut File::open(uploaded)?, &mut File::create(&path)?).map(drop))
        .map_err(|error| ReadFailure::Machine(format!("{}: {error}", path.display())))?;
    let file = name.to_owned();
    let film = Film {
        path: &path,
        name,
        pose_model,
        ffmpeg: order.ffmpeg.as_deref(),
        folder: order.folder.join("film"),
    };
    let told = move |done, total| {
        tell(Progress {
            stage: Stage::Poses,
            file: file.clone(),
            frame: None,
            done,
            total,
        });
    };
    told(0, 0);
    let mut capture = reader(&film, std::sync::Arc::new(told))?;
    order.files = std::mem::take(&mut capture.files);
    Ok(Some(capture))
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_media::Limits;

    /// A reader that finds somebody, and says where the film was.
    fn reader(film: &Film<'_>, tell: Tell) -> Result<FilmCapture, ReadFailure> {
        tell(1, 2);
        let note = format!("{} at {}", film.name, film.path.display());
        let bytes =
            std::fs::read(film.path).map_err(|error| ReadFailure::Machine(error.to_string()))?;
        if bytes.is_empty() {
            return Err(ReadFailure::of(violation(
                "EMPTY", film.name, None, "", "nobody",
            )));
        }
        Ok(FilmCapture {
            files: Files::from([("poses.pb".to_owned(), film.folder.join("poses.pb"))]),
            notes: vec![note],
            warnings: Vec::new(),
        })
    }

    fn order(folder: &Path, name: &str) -> Order {
        let mut order = Order::new(folder, &Limits::default());
        order.pose_model = Some(folder.join("models"));
        let path = folder.join("upload-000000");
        std::fs::write(&path, b"film").expect("writes");
        order.files.insert(name.to_owned(), path);
        order
    }

    #[test]
    fn a_film_alone_becomes_a_capture() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut order = order(folder.path(), "../Walk.MOV");
        let film = found(&mut order, Some(reader), |_| ()).expect("reads");
        let film = film.expect("is a film");
        let path = folder.path().join("film.mov");
        assert_eq!(film.notes, [format!("../Walk.MOV at {}", path.display())]);
        let files: Vec<&str> = order.files.keys().map(String::as_str).collect();
        assert_eq!(files, ["poses.pb"]);
    }

    #[test]
    fn other_captures_are_left_as_they_are() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut order = order(folder.path(), "capture.zip");
        let film = found(&mut order, Some(reader), |_| ()).expect("passes");
        assert!(film.is_none() && order.files.contains_key("capture.zip"));
    }

    #[test]
    fn without_a_pose_model_a_film_is_at_fault() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut order = order(folder.path(), "walk.mp4");
        for (reader, model) in [(None, true), (Some(reader as FilmReader), false)] {
            if !model {
                order.pose_model = None;
            }
            let failure = found(&mut order, reader, |_| ()).expect_err("nobody can read it");
            assert!(failure.to_string().contains("no pose model"), "{failure}");
        }
    }
}
