//! Ends of jobs without a result, and their reports to the coordinator.

use crate::{agent::control::StopReason, media::MediaError, objects::ObjectsError};
use std::error::Error;
use yoto_proto::{
    pose_track::{describe, violation},
    v1::{FailJobRequest, JobError, Violation},
};

/// The reason why a job ended without a result.
#[derive(Debug)]
pub enum JobFailure {
    /// The uploaded data is at fault: REJECTED, with all violations.
    Rejected(Vec<Violation>),
    /// The request is at fault: INVALID_SPEC, with all faulty fields.
    Invalid(Vec<Violation>),
    /// The user cancelled it, and the job stopped in order.
    Cancelled,
    /// The lease is gone; nothing may be reported under it.
    LeaseLost,
    /// The worker is shutting down and returns the job without a fault.
    Requeue,
    /// A resource of the job failed, not the job: it is to be retried later.
    TryLater {
        /// For programs: `OBJECTS`, `MACHINE`.
        code: &'static str,
        /// Human-readable, with the causes.
        message: String,
    },
    /// Anything else.
    Failed {
        /// For programs, e.g. `INTERNAL`, `OBJECTS`, `NO_CHECKPOINT`.
        code: &'static str,
        /// Human-readable, with the causes.
        message: String,
    },
}

impl JobFailure {
    /// A failure from an error with all its causes, and the failed action.
    pub fn failed(code: &'static str, doing: &str, error: &dyn Error) -> Self {
        let message = with_causes(doing, error);
        Self::Failed { code, message }
    }

    /// The same for faults where a retry may succeed.
    pub fn try_later(code: &'static str, doing: &str, error: &dyn Error) -> Self {
        let message = with_causes(doing, error);
        Self::TryLater { code, message }
    }

    /// A request whose one `field` is at fault; `spec` is the kind of job.
    pub fn invalid(spec: &str, field: &str, message: impl Into<String>) -> Self {
        Self::Invalid(vec![violation("INVALID", spec, None, field, message)])
    }

    /// The report to the coordinator under fencing token `token`; none when the lease is lost.
    pub fn into_request(self, job: &str, token: u64) -> Option<FailJobRequest> {
        let error = |code: &str, message: String, violations| {
            Some(JobError {
                code: code.into(),
                message,
                violations,
            })
        };
        let (error, cancelled, requeue) = match self {
            Self::LeaseLost => return None,
            Self::Cancelled => (None, true, false),
            Self::Requeue => (None, false, true),
            Self::Rejected(found) => (error("REJECTED", listed(&found), found), false, false),
            Self::Invalid(found) => (error("INVALID_SPEC", listed(&found), found), false, false),
            Self::TryLater { code, message } => (error(code, message, Vec::new()), false, true),
            Self::Failed { code, message } => (error(code, message, Vec::new()), false, false),
        };
        Some(FailJobRequest {
            job: job.into(),
            token,
            error,
            cancelled,
            requeue,
        })
    }
}

fn with_causes(doing: &str, error: &dyn Error) -> String {
    let mut message = format!("{doing}: {error}");
    let mut cause = error.source();
    while let Some(error) = cause {
        message += &format!(": {error}");
        cause = error.source();
    }
    message
}

fn listed(violations: &[Violation]) -> String {
    violations
        .iter()
        .map(describe)
        .collect::<Vec<_>>()
        .join("; ")
}

impl From<StopReason> for JobFailure {
    fn from(reason: StopReason) -> Self {
        match reason {
            StopReason::Cancelled => Self::Cancelled,
            StopReason::LeaseLost => Self::LeaseLost,
            StopReason::ShuttingDown => Self::Requeue,
        }
    }
}

impl From<ObjectsError> for JobFailure {
    fn from(error: ObjectsError) -> Self {
        if error.is_torn() {
            Self::failed("OBJECTS", "the object store", &error)
        } else {
            Self::try_later("OBJECTS", "the object store", &error)
        }
    }
}

impl From<MediaError> for JobFailure {
    fn from(error: MediaError) -> Self {
        Self::failed("INTERNAL", "encoding a picture", &error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_end_is_told_apart() {
        let request = |failure: JobFailure| failure.into_request("jobs/1", 7);
        assert_eq!(request(JobFailure::LeaseLost), None);
        let cancelled = request(JobFailure::Cancelled).expect("told");
        assert!(cancelled.cancelled && !cancelled.requeue && cancelled.error.is_none());
        let given_back = request(JobFailure::Requeue).expect("told");
        assert!(given_back.requeue && !given_back.cancelled && given_back.token == 7);
        let found = vec![violation(
            "NOT_FINITE",
            "poses.json",
            Some(17),
            "pose[41]",
            "NaN",
        )];
        let error = request(JobFailure::Rejected(found))
            .and_then(|r| r.error)
            .expect("told");
        assert_eq!(error.code, "REJECTED");
        assert_eq!(error.message, "poses.json frame 17: pose[41]: NaN");
        assert_eq!(error.violations[0].frame, Some(17));
        let later = JobFailure::TryLater {
            code: "OBJECTS",
            message: "out of reach".into(),
        };
        let later = request(later).expect("told");
        assert!(later.requeue && later.error.is_some_and(|it| it.code == "OBJECTS"));
    }
}
