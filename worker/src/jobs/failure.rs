//! Ends of jobs without a result, and their reports to the coordinator.

use crate::agent::control::StopReason;
use std::error::Error;
use yoto_film::PlanError;
use yoto_media::png::PngError;
use yoto_objects::ObjectsError;
use yoto_proto::checks::SpecFault;
use yoto_proto::pose_track::{describe, violation};
use yoto_proto::v1::{JobError, Violation};
use yoto_proto::worker::v1::end_job_request::{Cancelled, Outcome, Returned};

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

    /// This machine lacks what the job needs, e.g. space on its disk: the job waits, and gives the
    /// reason.
    pub fn machine(doing: &str, error: &dyn Error) -> Self {
        Self::try_later("MACHINE", doing, error)
    }

    /// A request whose one `field` is at fault; `spec` is the kind of job.
    pub fn invalid(spec: &str, field: &str, message: impl Into<String>) -> Self {
        Self::Invalid(vec![violation("INVALID", spec, None, field, message)])
    }

    /// Refuses an order with `faults`; `spec` is the kind of job. The coordinator made the same checks
    /// before it queued the job, perhaps in another version.
    pub fn refuse(spec: &str, faults: Vec<SpecFault>) -> Result<(), Self> {
        if faults.is_empty() {
            return Ok(());
        }
        let of = |fault: SpecFault| violation("INVALID", spec, None, fault.field, fault.message);
        Err(Self::Invalid(faults.into_iter().map(of).collect()))
    }

    /// The outcome for the coordinator; none when the lease is lost.
    pub fn into_outcome(self) -> Option<Outcome> {
        let error = |code: &str, message: String, violations| JobError {
            code: code.into(),
            message,
            violations,
        };
        Some(match self {
            Self::LeaseLost => return None,
            Self::Cancelled => Outcome::Cancelled(Cancelled {}),
            Self::Requeue => Outcome::Returned(Returned {}),
            Self::Rejected(found) => Outcome::Failed(error("REJECTED", listed(&found), found)),
            Self::Invalid(found) => Outcome::Failed(error("INVALID_SPEC", listed(&found), found)),
            Self::TryLater { code, message } => {
                Outcome::Postponed(error(code, message, Vec::new()))
            }
            Self::Failed { code, message } => Outcome::Failed(error(code, message, Vec::new())),
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

impl From<PlanError> for JobFailure {
    fn from(error: PlanError) -> Self {
        match error {
            PlanError::Invalid(violations) => Self::Invalid(violations),
            PlanError::Failed { code, message } => Self::Failed { code, message },
        }
    }
}

impl From<PngError> for JobFailure {
    fn from(error: PngError) -> Self {
        Self::failed("INTERNAL", "encoding a picture", &error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_end_is_told_apart() {
        assert_eq!(JobFailure::LeaseLost.into_outcome(), None);
        let told = |failure: JobFailure| failure.into_outcome().expect("is told");
        let cancelled = told(JobFailure::Cancelled);
        assert_eq!(cancelled, Outcome::Cancelled(Cancelled {}));
        let returned = told(JobFailure::Requeue);
        assert_eq!(returned, Outcome::Returned(Returned {}));
        let found = vec![violation(
            "NOT_FINITE",
            "poses.json",
            Some(17),
            "pose[41]",
            "NaN",
        )];
        let Outcome::Failed(error) = told(JobFailure::Rejected(found)) else {
            panic!("a failure");
        };
        assert_eq!(error.code, "REJECTED");
        assert_eq!(error.message, "poses.json frame 17: pose[41]: NaN");
        assert_eq!(error.violations[0].frame, Some(17));
        let later = JobFailure::TryLater {
            code: "OBJECTS",
            message: "out of reach".into(),
        };
        let Outcome::Postponed(error) = told(later) else {
            panic!("for later");
        };
        assert_eq!(error.code, "OBJECTS");
    }
}
