//! Failures of reading a capture.

use super::MAX_VIOLATIONS;
use yoto_media::MediaError;
use yoto_media::source::SourceError;
use yoto_proto::media_plan;
use yoto_proto::pose_track::{describe, violation};
use yoto_proto::v1::Violation;

/// The reason why an upload gave no shard. `E` is the error that ends the wait for the child.
#[derive(Debug, thiserror::Error)]
pub enum IngestError<E> {
    /// The capture is at fault; each entry names file, frame and field. Never empty.
    #[error("{}", lines(.0))]
    Rejected(Vec<Violation>),
    /// This machine is at fault: another try may succeed.
    #[error("{0}")]
    Machine(String),
    /// The child was killed from outside: another try may succeed.
    #[error("{0}")]
    Killed(String),
    /// The child's output is invalid.
    #[error("{0}")]
    Broken(String),
    /// The caller cancelled the wait.
    #[error("the wait for the upload was ended")]
    Stopped(E),
}

/// A fault of this machine while `doing` something.
pub(super) fn machine<E>(doing: &str, error: &std::io::Error) -> IngestError<E> {
    IngestError::Machine(format!("{doing}: {error}"))
}

/// The reason why a capture could not be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadFailure {
    /// A fault of the capture; each entry names file, frame and field. Never empty.
    #[error("{}", lines(.0))]
    Rejected(Vec<Violation>),
    /// A fault of this machine: another try may succeed.
    #[error("{0}")]
    Machine(String),
}

impl ReadFailure {
    /// A single fault of the capture.
    pub(super) fn of(fault: Violation) -> Self {
        Self::Rejected(vec![fault])
    }

    /// A fault of `file`, or of this machine.
    pub(super) fn at(error: MediaError, file: &str, frame: Option<u32>) -> Self {
        SourceError::at(error, file, frame).into()
    }

    /// A fault of the plan.
    pub(super) fn plan(code: &str, field: &str, message: impl Into<String>) -> Self {
        Self::of(violation(code, media_plan::FILE, None, field, message))
    }

    /// Both failures. A fault of the machine takes precedence, since faults of the capture may follow from it.
    pub(super) fn and(self, other: Self) -> Self {
        match (self, other) {
            (Self::Rejected(mut a), Self::Rejected(b)) => {
                a.extend(b);
                a.truncate(MAX_VIOLATIONS);
                Self::Rejected(a)
            }
            (machine @ Self::Machine(_), _) | (_, machine) => machine,
        }
    }
}

impl From<SourceError> for ReadFailure {
    fn from(error: SourceError) -> Self {
        match error {
            SourceError::Bad(fault) => Self::of(fault),
            SourceError::Machine(error) => Self::Machine(error.to_string()),
        }
    }
}

impl From<Vec<SourceError>> for ReadFailure {
    fn from(errors: Vec<SourceError>) -> Self {
        let none = Self::Rejected(Vec::new());
        errors.into_iter().map(Self::from).fold(none, Self::and)
    }
}

fn lines(violations: &[Violation]) -> String {
    violations
        .iter()
        .map(describe)
        .collect::<Vec<_>>()
        .join("; ")
}
