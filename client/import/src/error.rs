//! Errors of readers and writers: what is wrong, and at which file, frame and field.

use std::path::PathBuf;
use thiserror::Error;
use yoto_proto::pose_track::describe;
use yoto_proto::v1::Violation;

/// Why a capture or a motion can't be read or written.
#[derive(Debug, Error)]
pub enum ImportError {
    /// A local file could not be read or written.
    #[error("{action} {path}")]
    File {
        /// E.g. "reading".
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// A capture has faults.
    #[error("{} is not usable{}", capture(.place), lines(.violations))]
    BadCapture {
        /// The capture's folder or file; empty if the input has no name.
        place: String,
        /// The violations, never empty.
        violations: Vec<Violation>,
    },
    /// The input can't be used for the reason that the text gives, in full.
    #[error("{0}")]
    Unusable(String),
}

impl ImportError {
    /// Adds action and path to an I/O error.
    pub fn file(
        action: &'static str,
        path: impl Into<PathBuf>,
    ) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::File {
            action,
            path,
            source,
        }
    }
}

/// The capture in `place`, or, without a place, an input that has no name.
fn capture(place: &str) -> String {
    match place {
        "" => "the input".into(),
        place => format!("the capture {place}"),
    }
}

/// One indented line per violation.
fn lines(violations: &[Violation]) -> String {
    violations
        .iter()
        .map(|violation| format!("\n  {}", describe(violation).trim_start_matches(": ")))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::error::Error as _;
    use yoto_proto::pose_track::violation;

    #[test]
    fn a_bad_capture_names_file_frame_and_field() {
        let fault = violation("NOT_FINITE", "poses.json", Some(17), "pose[41]", "NaN");
        let bad = |place: &str| ImportError::BadCapture {
            place: place.into(),
            violations: vec![fault.clone()],
        };
        let fault = "is not usable\n  poses.json frame 17: pose[41]: NaN";
        let expected = format!("the capture captures/ada {fault}");
        assert_eq!(bad("captures/ada").to_string(), expected);
        assert_eq!(bad("").to_string(), format!("the input {fault}"));
    }

    #[test]
    fn an_error_of_the_system_is_the_cause_of_a_file_s() {
        let error = ImportError::file("reading", "a.json")(std::io::Error::other("gone"));
        assert_eq!(error.to_string(), "reading a.json");
        let cause = error.source().map(ToString::to_string);
        assert_eq!(cause.as_deref(), Some("gone"));
    }
}
