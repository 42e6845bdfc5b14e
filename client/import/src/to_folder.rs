//! An import as commands do it: from files to a capture folder, with progress and notes.

use crate::{Format, Imported, Options, TrackForm, best, read, write};
use std::path::Path;
use yoto_client::ClientError;
use yoto_media::picture_file;
use yoto_terminal::progress::{ProgressDisplay, count};

/// Path below a capture's folder of the picture of people with their numbers. In a folder of its own, as pictures beside `frames/`
/// can be a capture's background.
const PEOPLE: &str = "people/numbers.png";

/// Reads the capture in `source` and writes it to the folder `out`. Progress and notes are told to
/// the user.
///
/// # Errors
/// [`ClientError::BadCapture`] with file, frame and field; [`ClientError::File`] when the file
/// system fails.
pub fn to_folder(
    format: Format,
    source: &Path,
    out: &Path,
    form: TrackForm,
    options: &Options,
) -> Result<Imported, ClientError> {
    let mut imported = read(format, source, options)?;
    if let Some(number) = options.best {
        let mut display = ProgressDisplay::new("best frames");
        let progress = |done, of| display.count("frame", done, of);
        best::choose(&mut imported, number, options.ffmpeg.as_deref(), progress)?;
        display.clear();
    }
    for note in &imported.notes {
        yoto_terminal::detail!("note: {note}");
    }
    let mut display = ProgressDisplay::new("import");
    let bytes = write(&imported, out, form, |done, of, bytes| {
        display.frames(done, of, bytes);
    })?;
    if let Some(people) = &imported.found.people {
        let path = out.join(PEOPLE);
        picture_file::write(&path, people)
            .map_err(|error| ClientError::file("writing", &path)(std::io::Error::other(error)))?;
        yoto_terminal::detail!("the people with their numbers: {}", path.display());
    }
    let [width, height] = imported.track.image_size;
    display.finish_in_detail(&format!(
        "{} of {width}x{height}, {:.1} MB in {}",
        count(imported.track.frames.len(), "frame"),
        bytes as f64 / 1e6,
        out.display()
    ));
    Ok(imported)
}
