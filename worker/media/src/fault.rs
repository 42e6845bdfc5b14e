//! What can go wrong with media.

use std::path::{Path, PathBuf};
use thiserror::Error;
use yoto_proto::pose_track::violation;
use yoto_proto::v1::Violation;

/// The code of what needs more memory than there is.
pub const MEMORY_LIMIT: &str = "MEMORY_LIMIT";

/// Something wrong with a user's file, not yet with its place.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{message}")]
pub struct Fault {
    /// For programs: `UNDECODABLE`, `TOO_LARGE`, `SIZE_MISMATCH`, `UNSAFE_PATH`, …
    pub code: &'static str,
    /// For people.
    pub message: String,
    /// Frame of a video, counted from 0 as it is shown, when one is at fault.
    pub frame: Option<u32>,
    /// Field inside the file, e.g. a path inside an archive; mostly empty.
    pub field: String,
}

impl Fault {
    /// A fault of the file as a whole.
    pub fn new(code: &'static str, message: impl Into<String>) -> Self {
        Self {
            code,
            message: message.into(),
            frame: None,
            field: String::new(),
        }
    }

    /// The bytes can't be read as what they should be.
    pub fn undecodable(message: impl Into<String>) -> Self {
        Self::new("UNDECODABLE", message)
    }

    /// The same, at a frame of the video.
    #[must_use]
    pub fn in_frame(mut self, frame: usize) -> Self {
        self.frame = u32::try_from(frame).ok();
        self
    }

    /// The same, at a field of the file.
    #[must_use]
    pub fn in_field(mut self, field: impl Into<String>) -> Self {
        self.field = field.into();
        self
    }

    /// The same with its place; `frame` is the pose track's, and goes before the video's own.
    pub fn at(self, file: &str, frame: Option<u32>) -> Violation {
        violation(
            self.code,
            file,
            frame.or(self.frame),
            self.field,
            self.message,
        )
    }
}

/// Why media could not be read.
#[derive(Debug, Error)]
pub enum MediaError {
    /// The user's file is at fault.
    #[error(transparent)]
    Bad(#[from] Fault),
    /// This machine is: its disk, or a program that it lacks.
    #[error("{}: {source}", path.display())]
    Io {
        /// What was read or written.
        path: PathBuf,
        /// Why it could not be.
        source: std::io::Error,
    },
}

impl MediaError {
    /// For `map_err` on an operation at `path`.
    pub fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        |source| Self::Io {
            path: path.to_owned(),
            source,
        }
    }
}
