//! The plan for reading a capture's files: sources of pictures and masks, and the selected
//! frames.
//!
//! The plan is optional: [`Sources::find`] uses the names of the files, in the client that
//! uploads them and in the worker that reads them. What names can't express is in [`FILE`].

mod planned;
mod video_end;

pub use planned::Planned;
pub use video_end::{VideoContent, VideoEnd};

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
/// Extensions of pictures.
pub const PICTURE_ENDINGS: [&str; 4] = ["png", "jpg", "jpeg", "webp"];
/// Extensions of videos.
pub const VIDEO_ENDINGS: [&str; 10] = [
    "mp4", "mov", "m4v", "mkv", "webm", "avi", "ts", "mpg", "mpeg", "m2ts",
];
/// Extensions of archives.
pub const ARCHIVE_ENDINGS: [&str; 4] = [".zip", ".tar", ".tar.gz", ".tgz"];

/// `media.json`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MediaPlan {
    /// A folder of pictures, or a video, with or without its extension; by default `frames/`, else
    /// `video.*`.
    pub images: Option<String>,
    /// Source of the masks; by default `masks/`, else `masks.*` (a video), else
    /// `background.*` (a plate), else the pictures' alpha channel.
    pub masks: Option<MaskSource>,
    /// Meaning of mask pictures.
    pub mask_kind: MaskKind,
    /// Background of the pictures.
    pub background: BackgroundSetting,
    /// Treatment of the masks' edges.
    pub edges: EdgeSetting,
    /// Match of pose frames to frames of a video.
    pub timing: Timing,
    /// Selected pose frames.
    pub selection: Selection,
    /// Corrections of the pose track's numbers, and of the frames that masks belong to.
    pub correction: Correction,
}

impl MediaPlan {
    /// This plan with its missing fields from `own`, the capture's own plan.
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
            edges: or(self.edges, own.edges),
            timing: or(self.timing, own.timing),
            selection: or(self.selection, own.selection),
            correction: or(self.correction, own.correction),
        }
    }
}

/// Source of the masks.
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

/// Meaning of mask pictures.
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

/// What is known about the pictures' background.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BackgroundSetting {
    /// Nothing: the first frame with a person decides.
    #[default]
    Auto,
    /// The pictures show the person over black.
    Black,
    /// The pictures show the scene.
    Scene,
}

/// Treatment of the masks' edges.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EdgeSetting {
    /// If the background is the scene, coverage and the person's colours near the edges are estimated from the frames.
    #[default]
    Auto,
    /// The masks are used as they are.
    Given,
}

/// Background of the person.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Background {
    /// Black: colours are premultiplied by coverage already.
    Black,
    /// The scene: colours are to be multiplied by coverage.
    Scene,
}

/// Match of pose frames to frames of a video.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Timing {
    /// Pose frame n is the video's frame n, both from 0.
    #[default]
    Index,
    /// Pose frame n is at n / fps seconds, and uses the video's nearest frame in time, at most
    /// half a pose frame away.
    Time,
}

/// Selected pose frames: those with index `first`, `first + every`, … below `end`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Selection {
    /// First index.
    pub first: u32,
    /// One past the last index; none means to the end.
    pub end: Option<u32>,
    /// Take every n-th, 1 or more.
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
    /// Whether the frame is selected.
    pub fn takes(&self, index: u32) -> bool {
        index >= self.first
            && self.end.is_none_or(|end| index < end)
            && (index - self.first).is_multiple_of(self.every.max(1))
    }
}

/// Sources of a capture's pictures and masks.
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
    /// The pictures below this folder, named by frame index.
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
    /// When a source is missing or invalid, with the plan's field.
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
                .ok_or_else(|| ("images", format!("nothing exists at '{path}'")))?,
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
                .ok_or_else(|| ("masks", format!("nothing exists at '{path}'")))?,
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

/// The film that is the only file of a capture: a worker with a pose model finds poses and masks by itself.
pub fn film_alone<'a>(mut paths: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let first = paths.next()?;
    (paths.next().is_none() && has_ending(first, &VIDEO_ENDINGS)).then_some(first)
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
