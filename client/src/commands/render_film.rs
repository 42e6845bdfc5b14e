//! Renders as films.

use super::whole_file::{folder_of, keep};
use anyhow::{Context, ensure};
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;
use yoto_media::film::Film;

/// Whether `out` is the name of a film, and not that of a folder.
pub(super) fn is_film(out: &Path) -> bool {
    out.extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("mp4"))
}

/// Checks that a film may be written to `out`.
///
/// # Errors
/// If something is there already and may not be replaced.
pub(super) fn ensure_free(out: &Path, force: bool) -> anyhow::Result<()> {
    ensure!(
        force || !out.exists(),
        "{} is there already: choose another file (--out), or write over it (--force)",
        out.display()
    );
    Ok(())
}

/// Writes the `pictures` as a film of `fps` frames per second to `out`, whole or not at all.
///
/// # Errors
/// If a picture can't be read or has another size than the first, or writing fails.
pub(super) fn write(pictures: &[PathBuf], fps: f64, out: &Path) -> anyhow::Result<()> {
    let writing = || format!("writing {}", out.display());
    let folder = folder_of(out);
    std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
    let part = NamedTempFile::new_in(folder).with_context(writing)?;
    let mut film: Option<Film<BufWriter<&File>>> = None;
    let mut file = Some(BufWriter::new(part.as_file()));
    for path in pictures {
        let reading = || format!("reading {}", path.display());
        let picture = image::open(path).with_context(reading)?.to_rgb8();
        if let Some(file) = file.take() {
            let [width, height] = [picture.width(), picture.height()].map(|side| side as usize);
            film = Some(Film::new(file, width, height, fps).with_context(writing)?);
        }
        if let Some(film) = &mut film {
            film.push(&picture).with_context(reading)?;
        }
    }
    let film = film.context("no pictures for a film")?;
    film.finish().with_context(writing)?;
    drop(file);
    keep(part, out).with_context(writing)
}
