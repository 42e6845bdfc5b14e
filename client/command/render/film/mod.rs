//! Renders as films.

mod gif;
mod webp;

use crate::files::{folder_of, keep};
use anyhow::{Context, bail, ensure};
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;
use yoto_media::film::Film;
use yoto_proto::exports::EXTENSIONS;

/// Extensions of single files in lower case, besides the extensions of exports. Renders are never written to such
/// files.
const OTHER_FILES: [&str; 29] = [
    "3gp", "apng", "avi", "avif", "bmp", "bvh", "exr", "flv", "gz", "heic", "jpeg", "jpg", "json",
    "m4v", "mkv", "mov", "mpeg", "mpg", "mts", "npz", "ogv", "pdf", "svg", "tar", "tif", "tiff",
    "webm", "wmv", "zip",
];

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
        match extension(out)?.as_str() {
            "mp4" => Some(Self::Mp4),
            "webp" => Some(Self::WebP),
            "gif" => Some(Self::Gif),
            _ => None,
        }
    }
}

/// In lower case.
fn extension(out: &Path) -> Option<String> {
    Some(out.extension()?.to_str()?.to_ascii_lowercase())
}

/// Checks that `out` is a film that we write or a folder for pictures; an existing folder may have any
/// name.
///
/// # Errors
/// If its name belongs to a file of another kind.
pub(crate) fn ensure_known(out: &Path) -> anyhow::Result<()> {
    let exported = |it: &str| EXTENSIONS.contains(&it);
    let other = extension(out).filter(|it| exported(it) || OTHER_FILES.contains(&it.as_str()));
    let Some(other) = other.filter(|_| !out.is_dir()) else {
        return Ok(());
    };
    bail!(
        "{}: renders are not written as .{other}: name a film (.mp4, .webp or .gif), or a folder for \
         pictures",
        out.display()
    )
}

/// Whether `out` is the name of a film, not of a folder.
pub(crate) fn is_film(out: &Path) -> bool {
    Form::of(out).is_some()
}

/// Whether `out` can be transparent: a film as WebP, or a folder of pictures.
pub(crate) fn may_be_transparent(out: &Path) -> bool {
    Form::of(out).is_none_or(|form| form == Form::WebP)
}

/// Checks that a film may be written to `out`.
///
/// # Errors
/// If something is there already and may not be replaced.
pub(crate) fn ensure_free(out: &Path, force: bool) -> anyhow::Result<()> {
    ensure!(
        force || !out.exists(),
        "{} is there already: choose another file (--out), or overwrite it (--force)",
        out.display()
    );
    Ok(())
}

/// Writes the `pictures` as a film of `fps` frames per second to `out`, whole or not at all.
///
/// # Errors
/// If a picture can't be read or has another size than the first, or writing fails.
pub(crate) fn write(pictures: &[PathBuf], fps: f64, out: &Path) -> anyhow::Result<()> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_that_of_a_film_a_folder_or_refused() {
        for film in ["walk.mp4", "out/walk.MP4", "walk.WebP", "walk.GIF"] {
            assert!(is_film(Path::new(film)), "{film}");
            assert!(ensure_known(Path::new(film)).is_ok(), "{film}");
        }
        for folder in ["out", "out/v1.2", "out/ada.v2", "out/ada.final", ".hidden"] {
            assert!(!is_film(Path::new(folder)), "{folder}");
            assert!(ensure_known(Path::new(folder)).is_ok(), "{folder}");
        }
        for other in [
            "walk.mov",
            "walk.WEBM",
            "walk.avi",
            "a.png",
            "a.apng",
            "a.spz",
        ] {
            let error = ensure_known(Path::new(other)).expect_err(other).to_string();
            assert!(error.contains(".mp4, .webp or .gif"), "{error}");
        }
        let dir = tempfile::tempdir().expect("temporary folder");
        let folder = dir.path().join("frames.png");
        std::fs::create_dir(&folder).expect("makes it");
        assert!(ensure_known(&folder).is_ok());
    }
}
