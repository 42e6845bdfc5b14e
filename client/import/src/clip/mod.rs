//! The clip that poses belong to: a video, or a folder of pictures in order.

mod beyond;
mod frame_numbering;
mod frames;
mod numbers;

pub(crate) use beyond::{note as beyond, too_far};
pub(crate) use frame_numbering::FrameNumbering;
pub(crate) use frames::for_each;
pub(crate) use numbers::{left_out, number_in};

use crate::pictures::{DecodedClip, Mask, PictureFiles, Pictures, image_size};
use crate::{ImportError, Options};
use std::collections::HashMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use yoto_media::video::{Ffmpeg, Hdr, Video};
use yoto_media::{Limits, MediaError, MediaFault, Orientation, sniff};
use yoto_proto::pose_track::violation;
use yoto_proto::text::count;

/// Endings of pictures, lower case.
pub(crate) const PICTURES: [&str; 3] = [".png", ".jpg", ".jpeg"];

/// How the pictures in a video's file differ from the pictures as shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StoredPicture {
    /// The rotation from the stored pictures to the pictures as shown.
    pub orientation: Orientation,
    /// Width and height of a pixel of the file in pixels of the pictures as shown.
    pub pixel: [f64; 2],
}

/// A clip.
#[derive(Clone, Debug)]
pub(crate) struct Clip {
    path: PathBuf,
    /// The pictures of a folder, in the order of their names; empty for a video.
    files: Vec<PathBuf>,
    /// Frames by the names of their pictures, without endings.
    names: HashMap<OsString, usize>,
    /// Decodes videos that are not decoded in this process.
    ffmpeg: Ffmpeg,
    /// The light of a video's levels.
    hdr: Hdr,
    /// Width and height as shown, after the rotation that a phone's video declares.
    pub size: [u32; 2],
    /// How the stored pictures differ from the pictures as shown.
    pub stored: StoredPicture,
    /// Number of frames.
    pub frames: usize,
    /// Frames per second, if the file has times.
    pub fps: Option<f64>,
    /// Notes for people: how pictures differ from the file, and what the file lacks.
    pub notes: Vec<String>,
}

impl Clip {
    /// Opens the clip at `path` and decodes its first frame; videos of other kinds by the program
    /// `ffmpeg`, which is searched for when it has no name.
    ///
    /// # Errors
    /// When there is no video and no picture, or the first can't be decoded.
    pub(crate) fn open(path: &Path, options: &Options) -> Result<Self, ImportError> {
        let ffmpeg = Ffmpeg::find(options.ffmpeg.as_deref());
        if path.is_dir() {
            return Self::pictures_in(path, ffmpeg);
        }
        Self::video_at(path, ffmpeg, options.hdr)
    }

    /// Opens a clip again, to decode its pictures for a capture.
    ///
    /// # Errors
    /// The same errors as [`Self::open`].
    pub(crate) fn again(clip: &DecodedClip) -> Result<Self, ImportError> {
        Self::video_at(&clip.path, clip.ffmpeg.clone(), clip.hdr)
    }

    fn video_at(path: &Path, ffmpeg: Ffmpeg, hdr: Hdr) -> Result<Self, ImportError> {
        let (mut video, frames) = open_video(path, &ffmpeg, hdr)?;
        let times = video.times();
        let span = times.last().copied().unwrap_or_default();
        let fps = (frames > 1 && span > 0.0).then(|| (frames - 1) as f64 / span);
        let fps = fps.filter(|fps| fps.is_finite());
        let first = video.next(false).map_err(|error| unusable(path, error))?;
        let first = first.ok_or_else(|| fault(path, "EMPTY", "the video has no frames"))?;
        Ok(Self {
            path: path.to_owned(),
            files: Vec::new(),
            names: HashMap::new(),
            ffmpeg,
            hdr,
            size: [first.width as u32, first.height as u32],
            stored: StoredPicture {
                orientation: video.orientation(),
                pixel: video.pixel(),
            },
            frames,
            fps,
            notes: video.notes().to_vec(),
        })
    }

    fn pictures_in(path: &Path, ffmpeg: Ffmpeg) -> Result<Self, ImportError> {
        let files = listed(path, &PICTURES)?;
        let Some(first) = files.first() else {
            let message = "there are no pictures (PNG or JPEG) in this folder: a clip is a video, \
                           or a folder of pictures in order";
            return Err(fault(path, "MISSING", message));
        };
        let stem = |(frame, file): (usize, &PathBuf)| Some((file.file_stem()?.to_owned(), frame));
        let names = files.iter().enumerate().filter_map(stem);
        Ok(Self {
            size: image_size(first, 0)?,
            stored: StoredPicture {
                orientation: Orientation::AsStored,
                pixel: [1.0; 2],
            },
            frames: files.len(),
            path: path.to_owned(),
            names: names.collect(),
            ffmpeg,
            hdr: Hdr::Auto,
            files,
            fps: None,
            notes: Vec::new(),
        })
    }

    /// The frames that the options select.
    ///
    /// # Errors
    /// When they select no frame.
    pub(crate) fn selected(&self, options: &Options) -> Result<Vec<usize>, ImportError> {
        let (first, end, step) = options.frames.unwrap_or((0, self.frames, 1));
        let selected = (first..end.min(self.frames)).step_by(step.max(1));
        let selected: Vec<usize> = selected.collect();
        if selected.is_empty() {
            let message = format!(
                "the range selects none of its {}, which count from 0",
                count(self.frames, "frame")
            );
            return Err(fault(&self.path, "OUT_OF_RANGE", message));
        }
        Ok(selected)
    }

    /// The clip's own video, from its start.
    pub(crate) fn own_video(&self) -> Result<Video, ImportError> {
        Ok(open_video(&self.path, &self.ffmpeg, self.hdr)?.0)
    }

    /// A video of masks for the clip, and the number of its frames.
    pub(crate) fn video(&self, path: &Path) -> Result<(Video, usize), ImportError> {
        open_video(path, &self.ffmpeg, Hdr::Auto)
    }

    /// The clip's file or folder.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// The frame whose picture has the name `name`, with or without ending.
    pub(crate) fn named(&self, name: &str) -> Option<usize> {
        self.names.get(Path::new(name).file_stem()?).copied()
    }

    /// The pictures of `frames`, with the masks of each.
    pub(crate) fn pictures(&self, frames: &[usize], masks: Vec<Vec<Mask>>) -> Pictures {
        if self.files.is_empty() && self.hdr != Hdr::Auto {
            return Pictures::Decoded {
                clip: DecodedClip {
                    path: self.path.clone(),
                    ffmpeg: self.ffmpeg.clone(),
                    hdr: self.hdr,
                },
                masks,
            };
        }
        if self.files.is_empty() {
            return Pictures::Video {
                video: self.path.clone(),
                masks,
            };
        }
        let file = |(frame, masks): (&usize, Vec<Mask>)| {
            Some(PictureFiles {
                image: self.files.get(*frame)?.clone(),
                masks,
                over_black: false,
            })
        };
        Pictures::Files(frames.iter().zip(masks).filter_map(file).collect())
    }
}

/// Whether the file at `path` begins as a video.
pub(crate) fn is_video(path: &Path) -> bool {
    use std::io::Read;
    let mut start = Vec::new();
    let read = std::fs::File::open(path)
        .and_then(|file| file.take(sniff::PREFIX as u64).read_to_end(&mut start));
    let kind = sniff::kind(&start);
    read.is_ok()
        && matches!(
            kind,
            sniff::FileType::Mp4
                | sniff::FileType::Matroska
                | sniff::FileType::Avi
                | sniff::FileType::Mpeg
        )
}

fn open_video(path: &Path, ffmpeg: &Ffmpeg, hdr: Hdr) -> Result<(Video, usize), ImportError> {
    let limits = Limits::default();
    let video =
        Video::open_as(path, &limits, ffmpeg, true, hdr).map_err(|error| unusable(path, error))?;
    let frames = video.frames().unwrap_or_default();
    Ok((video, frames))
}

/// The files of a folder that end in one of `endings`, in the order of their names, in which numbers
/// count as numbers: 2 comes before 10.
pub(crate) fn listed(path: &Path, endings: &[&str]) -> Result<Vec<PathBuf>, ImportError> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(path).map_err(ImportError::file("listing", path))? {
        let entry = entry.map_err(ImportError::file("listing", path))?;
        let name = entry.file_name().to_string_lossy().to_ascii_lowercase();
        if endings.iter().any(|ending| name.ends_with(ending)) && entry.path().is_file() {
            files.push(entry.path());
        }
    }
    files.sort_by_cached_key(|path| by_numbers(&path.to_string_lossy()));
    Ok(files)
}

/// A sort key that compares digits in a row as one number. Names that differ only in leading zeros are in
/// alphabetical order.
fn by_numbers(name: &str) -> (Vec<(usize, String)>, String) {
    let mut parts: Vec<(usize, String)> = Vec::new();
    let mut digits = false;
    for letter in name.chars() {
        let digit = letter.is_ascii_digit();
        match parts.last_mut() {
            Some((_, part)) if digit == digits => part.push(letter),
            // Text has no length, so that it comes by its letters; numbers come before it.
            _ => parts.push((usize::MAX, letter.into())),
        }
        digits = digit;
    }
    for (length, part) in &mut parts {
        if part.starts_with(|letter: char| letter.is_ascii_digit()) {
            *part = part.trim_start_matches('0').to_owned();
            // A longer number is a larger one.
            *length = part.len();
        }
    }
    (parts, name.to_owned())
}

/// An error of media, with the file's name.
pub(crate) fn unusable(path: &Path, error: MediaError) -> ImportError {
    match error {
        MediaError::Bad(found) => bad(path, found),
        MediaError::Io { path, source } => ImportError::file("reading", path)(source),
    }
}

fn bad(path: &Path, found: MediaFault) -> ImportError {
    let (place, name) = located(path);
    ImportError::BadCapture {
        place,
        violations: vec![found.at(&name, None)],
    }
}

/// An error about the file at `path`.
pub(crate) fn fault(path: &Path, code: &str, message: impl Into<String>) -> ImportError {
    let (place, name) = located(path);
    ImportError::BadCapture {
        place,
        violations: vec![violation(code, &name, None, "", message)],
    }
}

fn located(path: &Path) -> (String, String) {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let folder = path.parent().unwrap_or(Path::new(""));
    (folder.display().to_string(), name.into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_in_the_order_of_their_numbers() {
        let folder = tempfile::tempdir().expect("a folder");
        for name in [
            "10.png",
            "1.png",
            "frame2.PNG",
            "2.png",
            "frame10.png",
            "x.txt",
        ] {
            std::fs::write(folder.path().join(name), b"").expect("writes");
        }
        let files = listed(folder.path(), &[".png"]).expect("lists");
        let names: Vec<_> = files.iter().filter_map(|path| path.file_name()).collect();
        assert_eq!(
            names,
            ["1.png", "2.png", "10.png", "frame2.PNG", "frame10.png"]
        );
    }
}
