//! How a capture's files are to be read: which hold the pictures, which the masks, and which
//! frames of them count.
//!
//! A capture need not say any of it: [`Sources::find`] goes by the names of its files, the
//! same for the client that uploads them and the worker that reads them. What names can't say
//! stands in [`FILE`].

mod planned;

pub use planned::Planned;

use crate::correction::Correction;
use crate::pose_track::violation;
use crate::v1::Violation;
use serde::{Deserialize, Serialize};
use std::fmt;

/// The file name of the plan inside a capture; it may be missing.
pub const FILE: &str = "media.json";
/// Top-level archives that hold a whole capture, pose track and all.
pub const CAPTURE_ARCHIVES: [&str; 4] = [
    "capture.zip",
    "capture.tar",
    "capture.tar.gz",
    "capture.tgz",
];
/// Endings of pictures that are read.
pub const PICTURE_ENDINGS: [&str; 4] = ["png", "jpg", "jpeg", "webp"];
/// Endings of files that are taken for videos.
pub const VIDEO_ENDINGS: [&str; 10] = [
    "mp4", "mov", "m4v", "mkv", "webm", "avi", "ts", "mpg", "mpeg", "m2ts",
];
/// Endings of archives that are unpacked.
pub const ARCHIVE_ENDINGS: [&str; 4] = [".zip", ".tar", ".tar.gz", ".tgz"];

/// `media.json`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MediaPlan {
    /// A folder of pictures or a video, whose ending may be left out; by default `frames/`, else
    /// `video.*`.
    pub images: Option<String>,
    /// What says where the person is; by default `masks/`, else `masks.*` (a video), else
    /// `background.*` (a plate), else the pictures' alpha channel.
    pub masks: Option<MaskSource>,
    /// What mask pictures mean.
    pub mask_kind: MaskKind,
    /// What stands around the person in the pictures.
    pub background: BackgroundSetting,
    /// How pose frames find their frame of a video.
    pub timing: Timing,
    /// Which pose frames count.
    pub selection: Selection,
    /// How the pose track's numbers are to be read, and which masks belong to which frames.
    pub correction: Correction,
}

impl MediaPlan {
    /// The plan with what it leaves unsaid taken from `own`, what the capture says itself.
    #[must_use]
    pub fn over(self, own: Self) -> Self {
        fn or<T: Default + PartialEq>(said: T, own: T) -> T {
            if said == T::default() { own } else { said }
        }
        Self {
            images: self.images.or(own.images),
            masks: self.masks.or(own.masks),
            mask_kind: or(self.mask_kind, own.mask_kind),
            background: or(self.background, own.background),
            timing: or(self.timing, own.timing),
            selection: or(self.selection, own.selection),
            correction: or(self.correction, own.correction),
        }
    }
}

/// What says where the person is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MaskSource {
    /// A folder of pictures or a video.
    Pictures(String),
    /// The alpha channel of the pictures themselves.
    Alpha,
    /// A picture of the same view without the person; masks are a difference key.
    Plate(String),
}

/// What mask pictures mean.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MaskKind {
    /// 0 outside, 255 inside, between on the edge.
    #[default]
    Coverage,
    /// 255 outside, 0 inside, between on the edge.
    Inverted,
    /// 0 outside, any other number inside.
    Labels,
}

/// What is known of the pictures' background beforehand.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BackgroundSetting {
    /// Nothing: the first frame with a person is looked at.
    #[default]
    Auto,
    /// The pictures show the person over black.
    Black,
    /// The pictures show a place.
    Scene,
}

/// What stands around the person.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Background {
    /// Black: colours are premultiplied by coverage already.
    Black,
    /// A place: colours are to be multiplied by coverage.
    Scene,
}

/// How pose frames find their frame of a video.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Timing {
    /// Pose frame n is the video's frame n, both from 0.
    #[default]
    Index,
    /// Pose frame n stands at n / fps seconds; the video's frame nearest in time serves, if
    /// it is no farther than half a pose frame.
    Time,
}

/// Which pose frames count: those whose index is `first`, `first + every`, … below `end`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Selection {
    /// First index.
    pub first: u32,
    /// One past the last index; none means to the end.
    pub end: Option<u32>,
    /// Take each n-th, 1 or more.
    pub every: u32,
}

impl Default for Selection {
    fn default() -> Self {
        Self {
            first: 0,
            end: None,
            every: 1,
        }
    }
}

impl Selection {
    /// Whether the frame counts.
    pub fn takes(&self, index: u32) -> bool {
        index >= self.first
            && self.end.is_none_or(|end| index < end)
            && (index - self.first).is_multiple_of(self.every.max(1))
    }
}

/// Where a capture's pictures and masks are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sources {
    /// Frames.
    pub images: Pictures,
    /// Masks.
    pub masks: MaskSource,
}

/// Pictures in a capture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Pictures {
    /// Those below this folder, named by frame index.
    Folder(String),
    /// The frames of this file.
    Video(String),
}

impl Pictures {
    /// The path: a folder's without a slash at its end.
    pub fn path(&self) -> &str {
        match self {
            Self::Folder(path) | Self::Video(path) => path,
        }
    }
}

impl fmt::Display for Pictures {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Folder(path) => write!(to, "the pictures in {path}/"),
            Self::Video(path) => write!(to, "the video {path}"),
        }
    }
}

impl Sources {
    /// Finds the sources among the files at `paths`, archives unpacked, by `plan` and names.
    ///
    /// # Errors
    /// What is missing or can't be, with the plan's field.
    pub fn find<'a>(
        plan: &MediaPlan,
        paths: impl Iterator<Item = &'a str> + Clone,
    ) -> Result<Self, Violation> {
        let sources = Self::look(plan, paths)
            .map_err(|(field, message)| violation("MISSING", FILE, None, field, message))?;
        let said = [
            ("correction.mask_shift", plan.correction.mask_shift != 0),
            ("mask_kind", plan.mask_kind != MaskKind::default()),
        ];
        match said.into_iter().find(|(_, said)| *said) {
            Some((field, _)) if sources.mask_pictures().is_none() => {
                let message = "is about pictures of masks, and this capture has none: the person \
                               is told by the alpha channel or the clean background";
                Err(violation("INVALID", FILE, None, field, message))
            }
            _ => Ok(sources),
        }
    }

    fn look<'a>(
        plan: &MediaPlan,
        paths: impl Iterator<Item = &'a str> + Clone,
    ) -> Result<Self, (&'static str, String)> {
        let images = match &plan.images {
            Some(path) => pictures(path, paths.clone())
                .or_else(|| stem(paths.clone(), path, &VIDEO_ENDINGS).map(Pictures::Video))
                .ok_or_else(|| ("images", format!("there is nothing at '{path}'")))?,
            None => pictures("frames", paths.clone())
                .or_else(|| stem(paths.clone(), "video", &VIDEO_ENDINGS).map(Pictures::Video))
                .ok_or_else(|| {
                    let message = "there are neither frames/ nor a video.* in the capture";
                    ("images", message.to_owned())
                })?,
        };
        let masks = match &plan.masks {
            Some(MaskSource::Pictures(path)) => pictures(path, paths)
                .map(|found| MaskSource::Pictures(found.path().to_owned()))
                .ok_or_else(|| ("masks", format!("there is nothing at '{path}'")))?,
            Some(MaskSource::Plate(path)) => {
                let found = paths.clone().any(|it| it == path);
                if !found {
                    return Err(("masks", format!("there is no file '{path}'")));
                }
                MaskSource::Plate(path.clone())
            }
            Some(MaskSource::Alpha) => MaskSource::Alpha,
            None => pictures("masks", paths.clone())
                .map(|found| MaskSource::Pictures(found.path().to_owned()))
                .or_else(|| stem(paths.clone(), "masks", &VIDEO_ENDINGS).map(MaskSource::Pictures))
                .or_else(|| stem(paths, "background", &PICTURE_ENDINGS).map(MaskSource::Plate))
                .unwrap_or(MaskSource::Alpha),
        };
        Ok(Self { images, masks })
    }

    /// The masks' pictures, where they have any.
    pub fn mask_pictures(&self) -> Option<Pictures> {
        match &self.masks {
            MaskSource::Pictures(path) if has_ending(path, &VIDEO_ENDINGS) => {
                Some(Pictures::Video(path.clone()))
            }
            MaskSource::Pictures(path) => Some(Pictures::Folder(path.clone())),
            MaskSource::Alpha | MaskSource::Plate(_) => None,
        }
    }
}

/// A folder with anything in it, or a video file.
fn pictures<'a>(path: &str, mut paths: impl Iterator<Item = &'a str>) -> Option<Pictures> {
    let path = path.trim_end_matches('/');
    if has_ending(path, &VIDEO_ENDINGS) {
        return paths
            .any(|it| it == path)
            .then(|| Pictures::Video(path.to_owned()));
    }
    paths
        .any(|it| {
            it.strip_prefix(path)
                .is_some_and(|rest| rest.starts_with('/'))
        })
        .then(|| Pictures::Folder(path.to_owned()))
}

/// The first top-level file called `stem` with one of `endings`.
fn stem<'a>(
    mut paths: impl Iterator<Item = &'a str>,
    stem: &str,
    endings: &[&str],
) -> Option<String> {
    let fits = |path: &str| {
        path.strip_prefix(stem)
            .and_then(|rest| rest.strip_prefix('.'))
            .is_some_and(|ending| endings.iter().any(|it| ending.eq_ignore_ascii_case(it)))
    };
    paths.find(|path| fits(path)).map(str::to_owned)
}

/// Whether `path` ends in a dot and one of `endings`, in letters of either case.
pub fn has_ending(path: &str, endings: &[&str]) -> bool {
    path.rsplit_once('.')
        .is_some_and(|(_, ending)| endings.iter().any(|it| ending.eq_ignore_ascii_case(it)))
}

/// The frame index in a picture's name: the last run of digits before the ending, as in
/// `frames/000017.png`, `img_17.jpg`. `None` without digits, or with too many.
pub fn index_in_name(path: &str) -> Option<u32> {
    let name = path.rsplit('/').next()?;
    let stem = name.rsplit_once('.').map_or(name, |(stem, _)| stem);
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let digits = stem.get(..end)?;
    let start = digits.rfind(|c: char| !c.is_ascii_digit()).map_or(0, |at| {
        at + digits[at..].chars().next().map_or(1, char::len_utf8)
    });
    digits.get(start..)?.parse().ok()
}

#[cfg(test)]
mod tests;
