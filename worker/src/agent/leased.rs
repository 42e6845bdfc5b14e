//! One leased job, from its lease to its report.

use super::control::{JobControl, StopReason};
use super::ended::JobEnd;
use super::heartbeat::Heartbeat;
use super::report::report;
use super::watchdog::silence;
use super::{Worker, WorkerError};
use crate::jobs::{self, JobContext, JobFailure};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::runtime::Handle;
use tokio::sync::{oneshot, watch};
use tokio::time::{sleep, timeout};
use tokio_util::sync::CancellationToken;
use yoto_proto::v1::{JobResult, Progress, job_spec};
use yoto_proto::worker::v1::{Claim, Lease};

/// Backpropagation recurses through the graph; the default stack of a thread is tight.
const STACK_BYTES: usize = 16 << 20;
/// Time in which a job without checkpoints stops in order when the worker shuts down. It has nothing to save, and its
/// token keeps what it still writes apart.
const AT_ONCE: Duration = Duration::from_secs(1);
/// Time limit for a report after the lease has expired without an answer, in leases. By the token, the coordinator
/// knows whether this worker still has the job.
const LEASES_TO_REPORT: u32 = 30;

type Outcome = Result<JobResult, JobFailure>;

/// A job leased by this worker.
pub(super) struct Leased<'a> {
    worker: &'a Worker,
    lease: Lease,
    claim: Claim,
    duration: Duration,
    control: Arc<JobControl>,
}

impl<'a> Leased<'a> {
    /// `asked` is when the lease was asked for: it can't have begun earlier, so a deadline
    /// counted from there is never late.
    pub(super) fn new(worker: &'a Worker, name: &str, lease: Lease, asked: Instant) -> Self {
        let duration = Duration::try_from_secs_f64(lease.lease_seconds).unwrap_or_default();
        Self {
            worker,
            claim: Claim {
                job: lease
                    .job
                    .as_ref()
                    .map(|job| job.name.clone())
                    .unwrap_or_default(),
                worker: name.to_owned(),
                token: lease.token,
            },
            duration,
            control: Arc::new(JobControl::new(asked + duration)),
            lease,
        }
    }

    /// Runs the job and reports its outcome, unless the lease is lost meanwhile. Returns how the lease has ended.
    ///
    /// # Errors
    /// [`WorkerError::Hung`] when the job shows no sign of life: its thread can't be ended.
    pub(super) async fn run(self, stopping: &CancellationToken) -> Result<JobEnd, WorkerError> {
        let (job, token) = (self.claim.job.clone(), self.claim.token);
        tracing::info!(job, token, "job leased");
        let (progress, latest) = watch::channel(Progress::default());
        let silent = latest.clone();
        let heartbeat = Heartbeat {
            client: self.worker.client.clone(),
            claim: self.claim.clone(),
            control: self.control.clone(),
            latest,
            every: self.worker.progress,
        };
        let keeper = tokio::spawn(heartbeat.keep(self.duration));
        let outcome = tokio::select! {
            outcome = self.outcome(progress, stopping) => outcome,
            silent = silence(&self.control, silent, self.worker.silence) => {
                self.control.stop(StopReason::LeaseLost);
                keeper.abort();
                return Err(WorkerError::Hung { job, seconds: silent.as_secs() });
            }
        };
        let ended = if let Err(failure) = &outcome {
            format!("{failure:?}")
        } else {
            "done".into()
        };
        let outcome = match outcome {
            // The coordinator did not answer in time. Once it does, the job is returned without a charge; if another
            // worker has the job, the report is refused.
            Err(JobFailure::LeaseLost) if !self.control.is_refused() => Err(JobFailure::Requeue),
            outcome => outcome,
        };
        let client = self.worker.client.clone();
        let given_up = async {
            self.control.lease_lost().await;
            sleep(self.duration * LEASES_TO_REPORT).await;
        };
        let end = tokio::select! {
            biased;
            () = self.control.refused() => {
                tracing::warn!(job, token, ended, "the lease is lost: the outcome is dropped");
                JobEnd::Returned
            }
            () = given_up => {
                tracing::warn!(job, token, ended, "no answer: the outcome is dropped");
                JobEnd::Returned
            }
            end = report(client, &self.claim, outcome) => {
                tracing::info!(job, token, ended, "job ended");
                end
            }
            () = async { stopping.cancelled().await; sleep(self.worker.report).await } => {
                tracing::warn!(job, token, ended, "shutting down before the outcome could be reported");
                JobEnd::Returned
            }
        };
        // A thread that still computes for this lease must write nothing more.
        self.control.stop(StopReason::LeaseLost);
        keeper.abort();
        Ok(end)
    }

    /// Waits for the job; once the worker is stopping, for the drain time at most if it is a training. A job that can't
    /// save is handed back at once.
    async fn outcome(
        &self,
        progress: watch::Sender<Progress>,
        stopping: &CancellationToken,
    ) -> Outcome {
        if stopping.is_cancelled() {
            return Err(JobFailure::Requeue);
        }
        let mut thread = self.start(progress)?;
        let outcome = tokio::select! {
            outcome = &mut thread => outcome,
            () = stopping.cancelled() => {
                self.control.stop(StopReason::ShuttingDown);
                let limit = match self.saves() {
                    true => self.worker.drain,
                    false => self.worker.drain.min(AT_ONCE),
                };
                match timeout(limit, &mut thread).await {
                    Ok(outcome) => outcome,
                    Err(_) => {
                        tracing::warn!(job = self.claim.job, "the job did not stop in time and is returned as it is");
                        return Err(JobFailure::Requeue);
                    }
                }
            }
        };
        // The thread always answers, even after a panic.
        outcome.unwrap_or_else(|_| Err(internal("the job's thread ended without an answer".into())))
    }

    /// Whether the job saves its state when it is stopped.
    fn saves(&self) -> bool {
        let spec = self.lease.job.as_ref().and_then(|it| it.spec.as_ref());
        matches!(
            spec.and_then(|it| it.kind.as_ref()),
            Some(job_spec::Kind::Train(_))
        )
    }

    /// Starts the job on its own thread. Not on the runtime's blocking pool: a runtime
    /// waits for that at exit, and a job that hangs would hang the process.
    fn start(
        &self,
        progress: watch::Sender<Progress>,
    ) -> Result<oneshot::Receiver<Outcome>, JobFailure> {
        let context = JobContext {
            claim: self.claim.clone(),
            device: self.worker.device.clone(),
            control: self.control.clone(),
            ingest: self.worker.ingest.clone(),
            lpips: self.worker.lpips.clone(),
            scratch: self.worker.scratch.path().to_owned(),
            objects: self.worker.objects.clone(),
            client: self.worker.client.clone(),
            progress,
            runtime: Handle::current(),
            pace: Default::default(),
        };
        let lease = self.lease.clone();
        let (answer, outcome) = oneshot::channel();
        std::thread::Builder::new()
            .name(format!("{} #{}", self.claim.job, self.claim.token))
            .stack_size(STACK_BYTES)
            .spawn(move || {
                // After the drain time, there is no receiver.
                let _ = answer.send(guarded(|| jobs::run(&context, &lease)));
            })
            .map_err(|error| JobFailure::failed("INTERNAL", "starting the job's thread", &error))?;
        Ok(outcome)
    }
}

/// Runs `job`; a panic becomes a failure with its message.
fn guarded(job: impl FnOnce() -> Outcome) -> Outcome {
    catch_unwind(AssertUnwindSafe(job)).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
        let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
        Err(internal(format!(
            "the job panicked: {}",
            text.unwrap_or_else(|| "no message".into())
        )))
    })
}

fn internal(message: String) -> JobFailure {
    JobFailure::Failed {
        code: "INTERNAL",
        message,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_a_failure_with_its_message() {
        let index = 4;
        let plain = guarded(|| panic!("no such slot"));
        let formatted = guarded(|| panic!("index {index}"));
        for (outcome, message) in [(plain, "no such slot"), (formatted, "index 4")] {
            let Err(JobFailure::Failed {
                code,
                message: found,
            }) = outcome
            else {
                panic!("a failure");
            };
            assert!(code == "INTERNAL" && found.contains(message), "{found}");
        }
    }
}
