//! A job's access to the outside, as blocking calls: a job has its own thread, so that tensor
//! work never delays the heartbeats.

use super::JobFailure;
use super::pace::Pace;
use crate::agent::control::{JobControl, StopReason};
use crate::retry::{is_stale_lease, is_transient};
use bytes::Bytes;
use std::convert::Infallible;
use std::future::Future;
use std::path::PathBuf;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tokio::runtime::Handle;
use tokio::sync::watch;
use tokio::time::timeout;
use tonic::{Code, Status};
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_device::PickedDevice;
use yoto_ingest::IngestSettings;
use yoto_objects::{Extent, Objects, ObjectsError, Part};
use yoto_proto::backoff::Backoff;
use yoto_proto::key::Connection;
use yoto_proto::names::{Collection, NameError};
use yoto_proto::v1::{Checkpoint, ObjectRef, Progress, RenderedFile};
use yoto_proto::worker::v1::worker_service_client::WorkerServiceClient;
use yoto_proto::worker::v1::{
    Claim, CommitOutputRequest, PublishCheckpointRequest, TakeRangeRequest, TakeRangeResponse,
};

/// Longest wait for an answer of the coordinator before a retry.
const CALL_TIMEOUT: Duration = Duration::from_secs(10);
/// Longest computation without signs of life of its own: a job that takes longer counts as hung.
const LONGEST_WORK: Duration = Duration::from_secs(1800);

/// A leased job's access to coordinator, objects and device; clones share it.
#[derive(Clone)]
pub struct JobContext {
    /// The claim on the job.
    pub claim: Claim,
    /// The device.
    pub device: PickedDevice,
    /// Whether the job may continue.
    pub control: Arc<JobControl>,
    /// Settings for reading uploads.
    pub ingest: Arc<IngestSettings>,
    /// Weights of the networks of LPIPS, if present.
    pub lpips: Option<LpipsWeights>,
    /// Where the job's files are as long as it runs.
    pub(crate) scratch: PathBuf,
    pub(crate) objects: Objects,
    pub(crate) client: WorkerServiceClient<Connection>,
    pub(crate) progress: watch::Sender<Progress>,
    pub(crate) runtime: Handle,
    pub(crate) pace: Arc<Mutex<Pace>>,
}

impl JobContext {
    /// The job's id, as in object keys.
    ///
    /// # Errors
    /// When the coordinator sent a name other than `jobs/{id}`.
    pub fn job_id(&self) -> Result<&str, JobFailure> {
        id(Collection::Jobs, &self.claim.job)
    }

    /// A new folder for files of this job, which is removed with all that is in it.
    ///
    /// # Errors
    /// When the scratch folder of this machine can't be written.
    pub(crate) fn folder(&self) -> std::io::Result<TempDir> {
        tempfile::Builder::new()
            .prefix("yoto-job-")
            .tempdir_in(&self.scratch)
    }

    /// Checks whether the job may continue.
    ///
    /// # Errors
    /// The failure for the reason to stop.
    pub fn check(&self) -> Result<(), JobFailure> {
        self.control.sign();
        self.control
            .stopped()
            .map_or(Ok(()), |reason| Err(reason.into()))
    }

    /// Replaces the progress that the next heartbeat carries.
    pub fn report(&self, progress: Progress) {
        self.control.sign();
        let device = self.device.info.adapter.clone();
        self.progress.send_replace(Progress { device, ..progress });
    }

    /// Reports that `done` of `total` pieces of `phase` are finished.
    pub fn report_pieces(&self, phase: &str, done: usize, total: usize) {
        self.report(Progress {
            phase: phase.into(),
            step: done as u64,
            total_steps: total as u64,
            fraction: done as f64 / total.max(1) as f64,
            seconds_left: self.seconds_left(done, total),
            ..Progress::default()
        });
    }

    /// Seconds until all of `total` pieces are finished, as fast as the first `done` were; `None` before the first one.
    fn seconds_left(&self, done: usize, total: usize) -> Option<f64> {
        let mut pace = self.pace.lock().unwrap_or_else(PoisonError::into_inner);
        let left = pace.seconds_left(Instant::now(), done, total);
        (left > 0.0 || done >= total).then_some(left)
    }

    /// An object's bytes, verified.
    ///
    /// # Errors
    /// As [`Objects::read`]; a lost lease ends the wait.
    pub fn get(&self, object: &ObjectRef) -> Result<Result<Bytes, ObjectsError>, JobFailure> {
        self.unless_lost(self.objects.read(object))
    }

    /// Copies an object into a file, verified.
    ///
    /// # Errors
    /// As [`Objects::copy_to`]; a lost lease ends the wait.
    pub fn get_to_file(&self, object: &ObjectRef, to: &std::path::Path) -> Result<(), JobFailure> {
        Ok(self.unless_lost(self.objects.copy_to(object, to))??)
    }

    /// Hands the bytes of the pieces of `part` to `take`, in their order, verified by the end.
    ///
    /// # Errors
    /// A lost lease ends the wait. The inner errors are those of [`Objects::read_part`].
    pub(crate) fn get_part<F: Clone + Send + Sync + 'static, E>(
        &self,
        part: Part<F>,
        take: impl FnMut(Extent<F>) -> Result<(), E>,
    ) -> Result<Result<Result<(), E>, ObjectsError>, JobFailure> {
        self.unless_lost(self.objects.read_part(part, take))
    }

    /// Writes an object.
    ///
    /// # Errors
    /// As [`Objects::put`]; a lost lease ends the wait.
    pub fn put(&self, key: &str, bytes: Vec<u8>) -> Result<ObjectRef, JobFailure> {
        Ok(self.unless_lost(self.objects.put(key, bytes.into()))??)
    }

    /// Makes `checkpoint` the model's newest, with retries until the coordinator answers.
    ///
    /// # Errors
    /// [`JobFailure::LeaseLost`] when the token is stale or the lease expires, or the
    /// coordinator's refusal.
    pub fn publish(&self, checkpoint: Checkpoint, save_seconds: f64) -> Result<(), JobFailure> {
        let request = PublishCheckpointRequest {
            claim: Some(self.claim.clone()),
            checkpoint: Some(checkpoint),
            save_seconds,
        };
        self.deliver("publishing a checkpoint", || {
            let (mut client, request) = (self.client.clone(), request.clone());
            async move { client.publish_checkpoint(request).await.map(drop) }
        })
    }

    /// Commits a file of a render or an export, with retries until the coordinator answers.
    ///
    /// # Errors
    /// As [`JobContext::publish`].
    pub fn commit(&self, file: RenderedFile) -> Result<(), JobFailure> {
        let request = CommitOutputRequest {
            claim: Some(self.claim.clone()),
            file: Some(file),
        };
        self.deliver("committing a file", || {
            let (mut client, request) = (self.client.clone(), request.clone());
            async move { client.commit_output(request).await.map(drop) }
        })
    }

    /// The next of the `pictures` of a render for this lease to draw, with retries until the coordinator
    /// answers; `drawn` is the first one of those that it has drawn before. None if the coordinator is of a
    /// version that knows no ranges.
    ///
    /// # Errors
    /// As [`JobContext::publish`].
    pub fn take_range(
        &self,
        pictures: u32,
        drawn: Option<u32>,
    ) -> Result<Option<TakeRangeResponse>, JobFailure> {
        let request = TakeRangeRequest {
            claim: Some(self.claim.clone()),
            pictures,
            drawn,
        };
        self.deliver("asking for pictures to draw", || {
            let (mut client, request) = (self.client.clone(), request.clone());
            async move {
                match client.take_range(request).await {
                    Ok(answer) => Ok(Some(answer.into_inner())),
                    Err(status) if status.code() == Code::Unimplemented => Ok(None),
                    Err(status) => Err(status),
                }
            }
        })
    }

    /// Repeats a call until the coordinator answers.
    fn deliver<F, T>(&self, doing: &str, call: impl Fn() -> F) -> Result<T, JobFailure>
    where
        F: Future<Output = Result<T, Status>>,
    {
        self.unless_lost(async {
            let mut backoff = Backoff::new(Duration::from_millis(200), Duration::from_secs(2));
            loop {
                match timeout(CALL_TIMEOUT, call()).await {
                    Ok(Ok(answer)) => return Ok(answer),
                    Ok(Err(status)) if is_stale_lease(&status) => {
                        self.control.stop(StopReason::LeaseLost);
                        return Err(JobFailure::LeaseLost);
                    }
                    Ok(Err(status)) if !is_transient(status.code()) => {
                        return Err(JobFailure::failed("INTERNAL", doing, &status));
                    }
                    Ok(Err(_)) | Err(_) => tokio::time::sleep(backoff.pause()).await,
                }
            }
        })?
    }

    /// Waits, unless the job must stop before `time` is over.
    ///
    /// # Errors
    /// The failure for the reason to stop.
    pub fn wait(&self, time: Duration) -> Result<(), JobFailure> {
        let until = Instant::now() + time;
        while Instant::now() < until {
            self.check()?;
            let left = until.saturating_duration_since(Instant::now());
            std::thread::sleep(left.min(Duration::from_millis(200)));
        }
        self.check()
    }

    /// Does a computation that can't be stopped on a thread of its own, and shows signs of life beside it, for
    /// [`LONGEST_WORK`] at most. If the job must stop first, what comes of it is dropped.
    ///
    /// # Errors
    /// The failure for the reason to stop; a panic, or a thread that can't be started.
    pub(crate) fn beside<T: Send + 'static>(
        &self,
        doing: &str,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, JobFailure> {
        let (answer, done) = mpsc::channel();
        let thread = std::thread::Builder::new()
            .name(format!("{}: {doing}", self.claim.job))
            // If the job has stopped, there is no receiver.
            .spawn(move || drop(answer.send(work())))
            .map_err(|error| JobFailure::machine(doing, &error))?;
        let began = Instant::now();
        loop {
            match done.recv_timeout(Duration::from_millis(200)) {
                Ok(done) => return Ok(done),
                Err(RecvTimeoutError::Timeout) => match self.control.stopped() {
                    Some(reason) => return Err(reason.into()),
                    None if began.elapsed() < LONGEST_WORK => self.control.sign(),
                    None => {}
                },
                Err(RecvTimeoutError::Disconnected) => {
                    // The job's own thread makes a failure of it.
                    if let Err(panic) = thread.join() {
                        std::panic::resume_unwind(panic);
                    }
                    return Err(JobFailure::Failed {
                        code: "INTERNAL",
                        message: format!("{doing}: the thread ended without an answer"),
                    });
                }
            }
        }
    }

    /// Waits for `work`, but not beyond the lease.
    fn unless_lost<T>(&self, work: impl Future<Output = T>) -> Result<T, JobFailure> {
        self.runtime.block_on(async {
            tokio::select! {
                biased;
                () = self.control.lease_lost() => Err(JobFailure::LeaseLost),
                done = work => Ok(done),
                // A slow store is no job that hangs.
                never = self.signs() => match never {},
            }
        })
    }

    /// Signs of life while the job waits for another process.
    async fn signs(&self) -> Infallible {
        loop {
            self.control.sign();
            tokio::time::sleep(Duration::from_secs(1)).await;
        }
    }
}

/// The id in a resource name from the coordinator.
pub(crate) fn id(collection: Collection, name: &str) -> Result<&str, JobFailure> {
    collection.parse(name).map_err(|error: NameError| {
        JobFailure::failed("INTERNAL", "the coordinator's answer", &error)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::test_context::context;
    use std::panic::{AssertUnwindSafe, catch_unwind};

    #[test]
    fn work_beside_a_job_shows_signs_of_life_and_does_not_hold_up_its_end() {
        let runtime = tokio::runtime::Runtime::new().expect("a runtime");
        let _inside = runtime.enter();
        let context = context();
        assert_eq!(context.beside("adding", || 1 + 1).expect("is done"), 2);
        let panicked = catch_unwind(AssertUnwindSafe(|| {
            context.beside("failing", || -> u32 { panic!("no such mesh") })
        }));
        let panic = panicked.expect_err("comes through");
        assert_eq!(panic.downcast_ref(), Some(&"no such mesh"));

        let control = context.control.clone();
        let (begin, begun) = mpsc::channel();
        let (release, released) = mpsc::channel::<()>();
        let job = std::thread::spawn(move || {
            context.beside("waiting", move || {
                begin.send(()).expect("the test waits");
                // Until the test lets it go.
                let _ = released.recv();
            })
        });
        begun.recv().expect("begins");
        let before = control.signs();
        while control.signs() == before {
            std::thread::sleep(Duration::from_millis(10));
        }
        control.stop(StopReason::Cancelled);
        let ended = job.join().expect("no panic");
        assert!(matches!(ended, Err(JobFailure::Cancelled)), "{ended:?}");
        drop(release);
    }
}
