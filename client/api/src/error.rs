//! Errors between a caller and the service, with actionable messages.
//!
//! The service answers with `google.rpc` details; a status printed as it is would hide
//! the one line that names the file, frame and field at fault.

use std::fmt;
use std::path::PathBuf;
use thiserror::Error;
use tonic::{Code, Status};
use tonic_types::StatusExt;
use yoto_proto::key::KeyError;
use yoto_proto::pose_track::describe;
use yoto_proto::reasons;
use yoto_proto::text::{LINE_CHARACTERS, one_line};
use yoto_proto::v1::{Job, Violation, job};

/// Errors of [`YotoClient`](super::YotoClient).
#[derive(Debug, Error)]
pub enum ClientError {
    /// Nothing answers at the address.
    #[error("can't reach a yoto service at {server}; is `yoto serve` running there?")]
    Connect {
        /// The given address.
        server: String,
        /// The transport's error.
        source: tonic::transport::Error,
    },
    /// The service at the address can't prove who it is, or does not trust this client.
    #[error("{0}")]
    Tls(String),
    /// The text is not a key. It is not repeated.
    #[error("{place} has no key")]
    Key {
        /// The variable or the file.
        place: String,
        /// What a key is.
        source: KeyError,
    },
    /// The service refused a request.
    #[error(transparent)]
    Refused(#[from] Refusal),
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
    /// A capture has faults, found before the upload or by its ingest job.
    #[error("{} is not usable{}", capture(.place), lines(.violations))]
    BadCapture {
        /// Folder or resource name.
        place: String,
        /// The violations, never empty.
        violations: Vec<Violation>,
    },
    /// A model without a checkpoint, by name.
    #[error("{0} has no checkpoint: train it first")]
    NoCheckpoint(String),
    /// A job ended without success.
    #[error("{}", job_ended(.0))]
    JobEnded(Box<Job>),
    /// No resource, or more than one, has the name.
    #[error("{0}")]
    Name(String),
    /// The service's answer violates the contract.
    #[error("the service broke its contract: {0}")]
    Contract(String),
}

impl ClientError {
    /// Turns a status into an error that names the action.
    pub(crate) fn refused(doing: impl Into<String>) -> impl FnOnce(Status) -> Self {
        let doing = doing.into();
        move |status| {
            Self::Refused(Refusal {
                doing,
                status: Box::new(status),
            })
        }
    }

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

/// A status of the service, with the client's action.
#[derive(Debug)]
pub struct Refusal {
    doing: String,
    status: Box<Status>,
}

impl Refusal {
    /// The status code, for callers that act on it.
    pub fn code(&self) -> Code {
        self.status.code()
    }
}

impl std::error::Error for Refusal {}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.doing, shown(self.status.message()))?;
        let details = self.status.get_error_details();
        let reason = reasons::spelled(&self.status);
        match &reason {
            Some(reason) => write!(f, " [{}]", shown(reason))?,
            None => write!(f, " [{:?}]", self.status.code())?,
        }
        for violation in details
            .bad_request()
            .map(|bad| bad.field_violations.as_slice())
            .unwrap_or_default()
        {
            let line = format!("{}: {}", violation.field, violation.description);
            // A single fault may be the message itself.
            if !self.status.message().contains(&line) {
                write!(f, "\n  {}", shown(&line))?;
            }
        }
        for violation in details
            .precondition_failure()
            .map(|failed| failed.violations.as_slice())
            .unwrap_or_default()
        {
            if !self.status.message().contains(&violation.description) {
                let line = format!("{} [{}]", violation.description, violation.r#type);
                write!(f, "\n  {}", shown(&line))?;
            }
        }
        // A connection that ends in its first words; a service with TLS ends one that does not encrypt.
        let broken = ["http2 error", "operation was canceled", "transport error"];
        if reason.is_none() && broken.iter().any(|it| self.status.message().contains(it)) {
            write!(
                f,
                "\n  does the service speak HTTP/2 there, and not https://?"
            )?;
        }
        // An answer with a reason comes from the service itself.
        if self.status.code() == Code::Unavailable && reason.is_none() {
            write!(f, "\n  is the service still running?")?;
        }
        Ok(())
    }
}

/// The capture in `place`, or, without a place, an input of no other name.
fn capture(place: &str) -> String {
    match place {
        "" => "the input".into(),
        place => format!("the capture {place}"),
    }
}

/// A text from the service or a worker as one safe line.
fn shown(text: &str) -> String {
    one_line(text, LINE_CHARACTERS)
}

/// One indented line per violation.
fn lines(violations: &[Violation]) -> String {
    violations
        .iter()
        .map(|violation| format!("\n  {}", describe(violation).trim_start_matches(": ")))
        .collect()
}

/// `jobs/x FAILED: … [DIVERGED]` with the violations below.
fn job_ended(job: &Job) -> String {
    let state = job::State::try_from(job.state)
        .unwrap_or_default()
        .as_str_name();
    match &job.error {
        Some(error) => format!(
            "{} {state}: {} [{}]{}",
            job.name,
            shown(&error.message),
            shown(&error.code),
            match error.violations.as_slice() {
                // A single fault may be the message itself.
                [one] if error.message.contains(&one.message) => String::new(),
                several => lines(several),
            }
        ),
        None => format!("{} {state}", job.name),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tonic_types::{ErrorDetails, FieldViolation};
    use yoto_proto::v1::JobError;

    #[test]
    fn a_refusal_names_reason_and_fields() {
        let mut details = ErrorDetails::with_error_info("BAD_SPEC", reasons::DOMAIN, []);
        details.set_bad_request(vec![FieldViolation::new(
            "spec.train.seconds",
            "-1 is below 0",
        )]);
        let status =
            Status::with_error_details(Code::InvalidArgument, "the job can't be created", details);
        let error = ClientError::refused("creating a job")(status);
        assert_eq!(
            error.to_string(),
            "creating a job: the job can't be created [BAD_SPEC]\n  spec.train.seconds: -1 is below 0"
        );
    }

    #[test]
    fn text_of_the_service_is_one_safe_line() {
        let text = "no\u{1b}]0;owned\u{7}\nerror: all is lost";
        let error = ClientError::refused("reading")(Status::not_found(text)).to_string();
        let expected = "reading: no\\u{1b}]0;owned\\u{7} error: all is lost [NotFound]";
        assert_eq!(error, expected);
        let job = Job {
            error: Some(JobError {
                message: text.repeat(1000),
                ..JobError::default()
            }),
            ..Job::default()
        };
        let error = ClientError::JobEnded(Box::new(job)).to_string();
        assert!(!error.contains(['\n', '\u{1b}']), "{error}");
        assert!(error.chars().count() < 2 * LINE_CHARACTERS);
    }

    #[test]
    fn a_refusal_without_details_names_the_code() {
        let error = ClientError::refused("reading jobs/1")(Status::not_found("no such job"));
        assert_eq!(error.to_string(), "reading jobs/1: no such job [NotFound]");
    }

    #[test]
    fn a_rejected_ingest_names_file_frame_and_field() {
        let violation = yoto_proto::pose_track::violation(
            "NOT_FINITE",
            "poses.json",
            Some(17),
            "pose[41]",
            "NaN",
        );
        let job = Job {
            name: "jobs/9".into(),
            state: job::State::Failed.into(),
            error: Some(JobError {
                code: "REJECTED".into(),
                message: "unusable".into(),
                violations: vec![violation],
            }),
            ..Job::default()
        };
        let text = ClientError::JobEnded(Box::new(job)).to_string();
        assert_eq!(
            text,
            "jobs/9 FAILED: unusable [REJECTED]\n  poses.json frame 17: pose[41]: NaN"
        );
    }
}
