//! Renders as films.

mod gif;
mod webp;

use super::whole_file::{folder_of, keep};
use anyhow::{Context, ensure};
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;
use yoto_media::film::Film;

/// The form of a film.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Mp4,
    WebP,
    Gif,
}

impl Form {
    /// By the name of the file; none of a folder.
    fn of(out: &Path) -> Option<Self> {
        let extension = out.extension()?.to_str()?.to_ascii_lowercase();
        match extension.as_str() {
            "mp4" => Some(Self::Mp4),
            "webp" => Some(Self::WebP),
            "gif" => Some(Self::Gif),
            _ => None,
        }
    }
}

/// Whether `out` is the name of a film, and not that of a folder.
pub(super) fn is_film(out: &Path) -> bool {
    Form::of(out).is_some()
}

/// Whether `out` can be transparent: a film as WebP, or a folder of pictures.
pub(super) fn may_be_transparent(out: &Path) -> bool {
    Form::of(out).is_none_or(|form| form == Form::WebP)
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
    let file = part.as_file();
    match Form::of(out) {
        Some(Form::Gif) => gif::write(pictures, fps, file),
        Some(Form::WebP) => webp::write(pictures, fps, file),
        Some(Form::Mp4) | None => write_mp4(pictures, fps, file),
    }
    .with_context(writing)?;
    keep(part, out).with_context(writing)
}

fn write_mp4(pictures: &[PathBuf], fps: f64, file: &File) -> anyhow::Result<()> {
    let mut film: Option<Film<BufWriter<&File>>> = None;
    let mut file = Some(BufWriter::new(file));
    for path in pictures {
        let reading = || format!("reading {}", path.display());
        let picture = image::open(path).with_context(reading)?.to_rgb8();
        if let Some(file) = file.take() {
            let [width, height] = [picture.width(), picture.height()].map(|side| side as usize);
            film = Some(Film::new(file, width, height, fps)?);
        }
        if let Some(film) = &mut film {
            film.push(&picture).with_context(reading)?;
        }
    }
    let film = film.context("no pictures for a film")?;
    Ok(film.finish()?)
}
