//! Why a worker has ended, and the ends that nobody asked for: after one job, or without any.

use super::WorkerError;
use crate::jobs::JobFailure;
use std::time::{Duration, Instant};
use tonic::Status;

/// Why a worker has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    /// It was asked to.
    Stopped,
    /// There was no job for it.
    Idle,
    /// It has run the one job that it was to run.
    OneJob(JobEnd),
}

/// How a worker's lease of a job has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JobEnd {
    /// The job SUCCEEDED; the same for a helper's part of it.
    Succeeded,
    /// The job was CANCELLED on request.
    Cancelled,
    /// The job FAILED.
    Failed,
    /// The job is in the queue again, or another worker has it.
    Returned,
}

impl JobEnd {
    /// The end that `failure` is once it is reported.
    pub(super) fn of(failure: &JobFailure) -> Self {
        match failure {
            JobFailure::Cancelled => Self::Cancelled,
            JobFailure::LeaseLost | JobFailure::Requeue | JobFailure::TryLater { .. } => {
                Self::Returned
            }
            JobFailure::Rejected(_) | JobFailure::Invalid(_) | JobFailure::Failed { .. } => {
                Self::Failed
            }
        }
    }
}

/// The time since a worker had a job.
#[derive(Debug)]
pub(super) struct Idle {
    since: Instant,
    limit: Option<Duration>,
    /// The fault of the last call, if it failed.
    fault: Option<String>,
}

impl Idle {
    /// Begins now; without a `limit` it never ends.
    pub(super) fn new(limit: Option<Duration>) -> Self {
        Self {
            since: Instant::now(),
            limit,
            fault: None,
        }
    }

    /// The coordinator has answered.
    pub(super) fn answered(&mut self) {
        self.fault = None;
    }

    /// The coordinator has not answered.
    pub(super) fn failed(&mut self, status: &Status) {
        self.fault = Some(status.message().to_owned());
    }

    /// The end of the worker, once the time is up.
    pub(super) fn end(&self) -> Option<Result<Ended, WorkerError>> {
        let limit = self.limit.filter(|limit| self.since.elapsed() >= *limit)?;
        Some(match &self.fault {
            None => Ok(Ended::Idle),
            Some(told) => Err(WorkerError::Unreachable {
                seconds: limit.as_secs(),
                told: told.clone(),
            }),
        })
    }

    /// `pause`, or what is left of the time.
    pub(super) fn at_most(&self, pause: Duration) -> Duration {
        match self.limit {
            Some(limit) => pause.min(limit.saturating_sub(self.since.elapsed())),
            None => pause,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_limit_ends_a_worker_and_silence_is_a_fault() {
        let mut idle = Idle::new(None);
        idle.since -= Duration::from_secs(3600);
        assert!(idle.end().is_none());
        idle.limit = Some(Duration::from_secs(4000));
        assert!(idle.end().is_none());
        assert!(idle.at_most(Duration::from_secs(1000)) <= Duration::from_secs(400));
        idle.limit = Some(Duration::from_secs(3600));
        assert!(matches!(idle.end(), Some(Ok(Ended::Idle))));
        idle.failed(&Status::unavailable("no route"));
        let error = idle.end().expect("ends").expect_err("is a fault");
        assert!(error.to_string().ends_with("3600 s: no route"), "{error}");
        idle.answered();
        assert!(matches!(idle.end(), Some(Ok(_))));
    }
}
