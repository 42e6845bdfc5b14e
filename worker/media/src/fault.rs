//! Errors of media.

use std::path::{Path, PathBuf};
use thiserror::Error;
use yoto_proto::pose_track::violation;
use yoto_proto::v1::Violation;

/// Code of faults that need more memory than available.
pub const MEMORY_LIMIT: &str = "MEMORY_LIMIT";

/// A fault of a user's file, without its location.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{message}")]
pub struct MediaFault {
    /// For programs: `UNDECODABLE`, `TOO_LARGE`, `SIZE_MISMATCH`, `UNSAFE_PATH`, …
    pub code: &'static str,
    /// Human-readable.
    pub message: String,
    /// The faulty frame of a video, counted from 0 in the order shown, if there is one.
    pub frame: Option<u32>,
    /// Field inside the file, e.g. a path inside an archive; usually empty.
    pub field: String,
}

impl MediaFault {
    /// A fault of the file as a whole.
    pub fn new(code: &'static str, message: impl Into<String>) -> Self {
        Self {
            code,
            message: message.into(),
            frame: None,
            field: String::new(),
        }
    }

    /// The bytes are not of the expected format.
    pub fn undecodable(message: impl Into<String>) -> Self {
        Self::new("UNDECODABLE", message)
    }

    /// This fault at a frame of the video.
    #[must_use]
    pub fn in_frame(mut self, frame: usize) -> Self {
        self.frame = u32::try_from(frame).ok();
        self
    }

    /// This fault at a field of the file.
    #[must_use]
    pub fn in_field(mut self, field: impl Into<String>) -> Self {
        self.field = field.into();
        self
    }

    /// The fault with its location; `frame` is the pose track's, which takes precedence over the video's.
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

/// The reason why media could not be read.
#[derive(Debug, Error)]
pub enum MediaError {
    /// The user's file is at fault.
    #[error(transparent)]
    Bad(#[from] MediaFault),
    /// This machine is at fault: its disk, or a missing program.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The cause.
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
