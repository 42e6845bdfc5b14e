//! An import as commands do it: from files to a capture folder, with progress and notes.

use crate::{Format, ImportError, Imported, Options, Stage, TrackForm, best, read, write};
use std::path::Path;
use yoto_media::picture_file;
use yoto_proto::text::count;

/// The picture of people with their numbers, below a capture's folder. It has a folder of its own, since pictures beside
/// `frames/` can be a capture's background.
const PEOPLE: &str = "people/numbers.png";

/// Reads the capture in `source` and writes it to the folder `out`. Progress and notes go to
/// `options.progress`.
///
/// # Errors
/// [`ImportError::BadCapture`] with file, frame and field; [`ImportError::File`] when the file
/// system fails.
pub fn to_folder(
    format: Format,
    source: &Path,
    out: &Path,
    form: TrackForm,
    options: &Options,
) -> Result<Imported, ImportError> {
    let mut imported = read(format, source, options)?;
    if let Some(number) = options.best {
        let running = options.progress.start(Stage::BestFrames);
        let progress = |done, total| running.count(done, total);
        best::choose(&mut imported, number, options.ffmpeg.as_deref(), progress)?;
    }
    for note in &imported.notes {
        options.progress.detail(&format!("note: {note}"));
    }
    let running = options.progress.start(Stage::Write);
    let bytes = write(&imported, out, form, |done, total, bytes| {
        running.written(done, total, bytes);
    })?;
    if let Some(people) = &imported.found.people {
        let path = out.join(PEOPLE);
        picture_file::write(&path, people)
            .map_err(|error| ImportError::file("writing", &path)(std::io::Error::other(error)))?;
        let path = path.display();
        options
            .progress
            .detail(&format!("the people with their numbers: {path}"));
    }
    let [width, height] = imported.track.image_size;
    running.finish(format!(
        "{} of {width}x{height}, {:.1} MB in {}",
        count(imported.track.frames.len(), "frame"),
        bytes as f64 / 1e6,
        out.display()
    ));
    Ok(imported)
}
