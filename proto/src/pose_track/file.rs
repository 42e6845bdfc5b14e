//! The pose track in files: constant cameras, and either convention of pixel centres.

use super::check::{Violations, located};
use super::{
    BINARY_FILE, FILE, Frame, NO_DISTORTION, PoseTrack, Skeleton, describe, is_binary, violation,
};
use crate::v1::Violation;
use serde::{Deserialize, Serialize};

/// A pose track with all fields that a file may leave out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct FileTrack {
    pub skeleton: Skeleton,
    pub image_size: [u32; 2],
    pub fps: f64,
    /// Centre of the first pixel: 0 or 0.5.
    #[serde(default = "half")]
    pub pixel_centre: f64,
    #[serde(default, skip_serializing_if = "undistorted")]
    pub distortion: [f64; 5],
    /// Camera of every frame without its own.
    #[serde(default, skip_serializing_if = "FileCamera::is_empty")]
    pub camera: FileCamera,
    pub frames: Vec<FileFrame>,
}

/// Intrinsics and extrinsics, if given.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct FileCamera {
    #[serde(rename = "K", default, skip_serializing_if = "Option::is_none")]
    pub k: Option<[[f64; 3]; 3]>,
    #[serde(rename = "E", default, skip_serializing_if = "Option::is_none")]
    pub e: Option<[[f64; 4]; 4]>,
}

/// A frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct FileFrame {
    pub index: u32,
    pub pose: Vec<f64>,
    pub translation: [f64; 3],
    #[serde(rename = "K", default, skip_serializing_if = "Option::is_none")]
    pub k: Option<[[f64; 3]; 3]>,
    #[serde(rename = "E", default, skip_serializing_if = "Option::is_none")]
    pub e: Option<[[f64; 4]; 4]>,
}

/// The word of other languages for a number that JSON lacks, at this position of a text, both counted
/// from 1.
fn not_a_number(text: &[u8], line: usize, column: usize) -> Option<&'static str> {
    let line = text
        .split(|byte| *byte == b'\n')
        .nth(line.checked_sub(1)?)?;
    // serde_json stops at a word's first or second letter, or behind a sign.
    let near = line.get(column.saturating_sub(3)..)?;
    let words = ["-Infinity", "Infinity", "NaN", "nan", "-inf", "inf"];
    let begins = |word: &&str| {
        (0..3).any(|at| {
            near.get(at..)
                .is_some_and(|it| it.starts_with(word.as_bytes()))
        })
    };
    words.into_iter().find(begins)
}

fn half() -> f64 {
    0.5
}

fn undistorted(distortion: &[f64; 5]) -> bool {
    *distortion == NO_DISTORTION
}

impl FileCamera {
    fn is_empty(&self) -> bool {
        self.k.is_none() && self.e.is_none()
    }
}

impl PoseTrack {
    /// Reads and checks a pose track.
    ///
    /// # Errors
    /// All violations, up to a limit; never empty.
    pub fn from_json(bytes: &[u8]) -> Result<Self, Vec<Violation>> {
        FileTrack::from_json(bytes)?.checked()
    }

    /// As [`Self::from_json`], in protocol buffers (`yoto.v1.PoseTrack`).
    ///
    /// # Errors
    /// As [`Self::from_json`].
    pub fn from_binary(bytes: &[u8]) -> Result<Self, Vec<Violation>> {
        FileTrack::from_binary(bytes)
            .and_then(FileTrack::checked)
            .map_err(|violations| located(violations, BINARY_FILE))
    }

    /// The track of a file whose numbers are to be corrected before they are checked: lengths in
    /// millimetres are out of range. Required fields are still checked.
    ///
    /// # Errors
    /// When the file can't be read, or lacks a required field.
    pub fn from_file_unchecked(name: &str, bytes: &[u8]) -> Result<Self, Vec<Violation>> {
        let file = if is_binary(name) {
            FileTrack::from_binary(bytes)?
        } else {
            FileTrack::from_json(bytes)?
        };
        let mut report = Violations::new();
        let track = file.resolved(&mut report);
        let violations = report.into_violations();
        if violations.is_empty() {
            Ok(track)
        } else {
            Err(violations)
        }
    }

    /// The track in protocol buffers; a constant camera is written once.
    pub fn to_binary(&self) -> Vec<u8> {
        FileTrack::from(self.clone()).to_binary()
    }
}

impl FileTrack {
    fn from_json(bytes: &[u8]) -> Result<Self, Vec<Violation>> {
        let mut reader = serde_json::Deserializer::from_slice(bytes);
        let track = serde_path_to_error::deserialize(&mut reader);
        let unreadable = |field, message| vec![violation("UNREADABLE", FILE, None, field, message)];
        let track = track.map_err(|error| {
            let field = match error.path().to_string().as_str() {
                "." | "?" => String::new(),
                path => path.to_owned(),
            };
            let error = error.into_inner();
            // serde_json reads NaN and 1e999 as faults of syntax and range.
            match not_a_number(bytes, error.line(), error.column()) {
                Some(found) => {
                    let position = format!("line {} column {}", error.line(), error.column());
                    unreadable(
                        field,
                        format!("{found} is not a number that JSON has ({position})"),
                    )
                }
                None => unreadable(field, error.to_string()),
            }
        })?;
        let ended = reader.end();
        ended.map_err(|error| unreadable(String::new(), error.to_string()))?;
        Ok(track)
    }

    /// The track with a camera in every frame and pixel centres at +0.5, checked.
    fn checked(self) -> Result<PoseTrack, Vec<Violation>> {
        let mut report = Violations::new();
        let track = self.resolved(&mut report);
        let mut violations = report.into_violations();
        violations.extend(track.check());
        if violations.is_empty() {
            Ok(track)
        } else {
            Err(violations)
        }
    }

    fn resolved(self, report: &mut Violations) -> PoseTrack {
        let shift = 0.5 - self.pixel_centre;
        if shift != 0.0 && shift != 0.5 {
            let message = format!(
                "{}: the first pixel's centre is at 0 or at 0.5",
                self.pixel_centre
            );
            report.add("OUT_OF_RANGE", None, "pixel_centre", message);
        }
        let all = self.camera;
        let frames = self.frames.into_iter().map(|frame| {
            let at = Some(frame.index);
            let mut needed = |field: &str, missing: bool| {
                if missing {
                    let message = "neither the frame nor the track's camera has it";
                    report.add("MISSING", at, field, message);
                }
            };
            let (k, e) = (frame.k.or(all.k), frame.e.or(all.e));
            needed("K", k.is_none());
            needed("E", e.is_none());
            // The missing field was reported; the placeholder adds no second violation.
            let mut k = k.unwrap_or([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
            k[0][2] += shift;
            k[1][2] += shift;
            let identity = |i: usize, j: usize| if i == j { 1.0 } else { 0.0 };
            Frame {
                index: frame.index,
                pose: frame.pose,
                translation: frame.translation,
                k,
                e: e.unwrap_or_else(|| {
                    std::array::from_fn(|i| std::array::from_fn(|j| identity(i, j)))
                }),
            }
        });
        PoseTrack {
            frames: frames.collect(),
            skeleton: self.skeleton,
            image_size: self.image_size,
            fps: self.fps,
            distortion: self.distortion,
        }
    }
}

/// For tracks inside other files; [`PoseTrack::check`] checks the values.
impl TryFrom<FileTrack> for PoseTrack {
    type Error = String;

    fn try_from(file: FileTrack) -> Result<Self, String> {
        let mut report = Violations::new();
        let track = file.resolved(&mut report);
        match report.into_violations().first() {
            None => Ok(track),
            Some(violation) => Err(describe(violation)),
        }
    }
}

impl From<PoseTrack> for FileTrack {
    fn from(track: PoseTrack) -> Self {
        let frames = track.frames.into_iter().map(|frame| FileFrame {
            index: frame.index,
            pose: frame.pose,
            translation: frame.translation,
            k: Some(frame.k),
            e: Some(frame.e),
        });
        Self {
            frames: frames.collect(),
            skeleton: track.skeleton,
            image_size: track.image_size,
            fps: track.fps,
            pixel_centre: half(),
            distortion: track.distortion,
            camera: FileCamera::default(),
        }
    }
}
