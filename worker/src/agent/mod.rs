//! The worker's main loop: register, lease, run, report, and shut down in order.
//!
//! One job at a time. [`heartbeat`] renews the lease in its own task while the job computes on its
//! own thread; [`control`] is their only shared state.

mod config;
pub mod control;
mod ended;
mod error;
mod heartbeat;
mod leased;
mod report;
mod scratch;
#[cfg(test)]
mod silence_tests;
mod watchdog;

use crate::retry::{is_transient, is_unreadable};
use config::SLACK;
pub use config::{KINDS, WorkerConfig};
use ended::Idle;
pub use ended::{Ended, JobEnd};
pub use error::WorkerError;
use leased::Leased;
use scratch::Scratch;
use std::cmp::Ordering;
use std::future::Future;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::time::{sleep, timeout};
use tokio_util::sync::CancellationToken;
use tonic::transport::Channel;
use tonic::{Code, Status};
use url::Url;
use uuid::Uuid;
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_device::PickedDevice;
use yoto_ingest::{Confinement, IngestSettings};
use yoto_objects::{Objects, Rights};
use yoto_proto::backoff::Backoff;
use yoto_proto::key::{Connection, connection};
use yoto_proto::limits::ANSWER_BYTES;
use yoto_proto::orders;
use yoto_proto::v1::JobKind;
use yoto_proto::worker::v1::worker_service_client::WorkerServiceClient;
use yoto_proto::worker::v1::{
    Lease, LeaseJobRequest, RegisterWorkerRequest, RegisterWorkerResponse, WaitForJobRequest,
};

/// Longest wait for an answer before a retry.
const CALL_TIMEOUT: Duration = Duration::from_secs(10);
/// A worker, ready to [`run`](Self::run).
pub struct Worker {
    client: WorkerServiceClient<Connection>,
    objects: Objects,
    device: PickedDevice,
    display_name: String,
    kinds: Vec<JobKind>,
    embedded: bool,
    poll: Duration,
    idle_poll: Duration,
    progress: Duration,
    drain: Duration,
    report: Duration,
    one_job: bool,
    max_idle: Option<Duration>,
    silence: Duration,
    ingest: Arc<IngestSettings>,
    lpips: Option<LpipsWeights>,
    scratch: Scratch,
    after_job: fn(),
}

impl Worker {
    /// A worker that asks the coordinator behind `channel` for work, reads and writes
    /// objects at `objects_url` (`file:///…` or `s3://…`), and computes on `device`.
    ///
    /// # Errors
    /// When the object store does not open, or a setting is invalid.
    pub fn new(
        channel: Channel,
        objects_url: &Url,
        device: PickedDevice,
        config: WorkerConfig,
    ) -> Result<Self, WorkerError> {
        Self::with_objects(channel, Objects::open(objects_url)?, device, config)
    }

    /// The same with an object store that is already open.
    ///
    /// # Errors
    /// When the scratch folder can't be made or a setting is invalid.
    pub fn with_objects(
        channel: Channel,
        objects: Objects,
        device: PickedDevice,
        config: WorkerConfig,
    ) -> Result<Self, WorkerError> {
        let scratch = Scratch::make(&config.scratch).map_err(|source| WorkerError::Scratch {
            folder: config.scratch,
            source,
        })?;
        Ok(Self {
            client: WorkerServiceClient::new(connection(channel, config.key))
                .max_decoding_message_size(ANSWER_BYTES),
            objects: objects.patient(),
            device,
            display_name: config.display_name,
            kinds: config.kinds,
            embedded: config.embedded,
            poll: seconds("poll_seconds", config.poll_seconds)?,
            idle_poll: seconds("idle_poll_seconds", config.idle_poll_seconds)?,
            progress: seconds("progress_seconds", config.progress_seconds)?,
            drain: seconds("drain_seconds", config.drain_seconds)?,
            report: seconds("report_seconds", config.report_seconds)?,
            one_job: config.one_job,
            max_idle: (config.max_idle_seconds)
                .map(|idle| seconds("max_idle_seconds", idle))
                .transpose()?,
            silence: seconds("silence_seconds", config.silence_seconds)?,
            ingest: Arc::new(config.ingest),
            lpips: config.lpips,
            scratch,
            after_job: config.after_job,
        })
    }

    /// Checks the object store, leases and runs jobs until `shutdown`, then lets a training save, returns a job that can't, and ends
    /// within the times for both. Returns earlier after one job, or when it has been idle for too long, if its configuration
    /// says so.
    ///
    /// # Errors
    /// When the store can't be used, the coordinator refuses this worker, or a job hangs. An unreachable coordinator is an error
    /// only for a worker that may not be idle for ever.
    pub async fn run(self, shutdown: impl Future<Output = ()>) -> Result<Ended, WorkerError> {
        self.tell_confinement()?;
        // The coordinator has checked its own.
        if !self.embedded {
            self.objects.check(Rights::ReadWrite).await?;
        }
        let stopping = CancellationToken::new();
        let work = self.work(&stopping);
        tokio::pin!(work);
        tokio::select! {
            ended = &mut work => return ended,
            () = shutdown => stopping.cancel(),
        }
        // A coordinator that does not answer would delay the end.
        let limit = self
            .drain
            .saturating_add(self.report)
            .saturating_add(SLACK / 2);
        match timeout(limit, work).await {
            Ok(ended) => ended,
            Err(_) => {
                tracing::warn!("the worker ends without an answer of the coordinator");
                Ok(Ended::Stopped)
            }
        }
    }

    /// Logs how far this kernel confines what reads files of users.
    ///
    /// # Errors
    /// When it has to confine it and does not.
    fn tell_confinement(&self) -> Result<(), WorkerError> {
        let decodes = |kind: &JobKind| matches!(kind, JobKind::Ingest | JobKind::Render);
        if !self.kinds.iter().any(decodes) {
            return Ok(());
        }
        let found = Confinement::of_this_machine();
        let found = found.map_err(|told| WorkerError::Confinement { told })?;
        if self.ingest.require_confinement && !found.is_whole() {
            let told = found.to_string();
            return Err(WorkerError::Unconfined { told });
        }
        // No warning: systems without Landlock would show it above each run with a user's own files.
        tracing::info!("{found}");
        Ok(())
    }

    async fn work(&self, stopping: &CancellationToken) -> Result<Ended, WorkerError> {
        let mut name = String::new();
        let mut pauses = Backoff::new(self.poll, self.idle_poll);
        let mut idle = Idle::new(self.max_idle);
        // The same until it is answered: a lease whose answer was lost is found again.
        let mut call = Uuid::new_v4();
        while !stopping.is_cancelled() {
            if name.is_empty() {
                match self.register(stopping, &mut idle).await? {
                    Some(given) => name = given,
                    None => break,
                }
            }
            // Not raced against shutdown: a lease with an unread answer blocks its job.
            let asked = Instant::now();
            let answer = self.lease(&name, call).await;
            let told_of_none = matches!(answer, Ok(None));
            if answer.is_ok() {
                call = Uuid::new_v4();
            }
            match answer {
                Ok(Some(lease)) => {
                    let end = Leased::new(self, &name, lease, asked).run(stopping).await?;
                    (self.after_job)();
                    if self.one_job {
                        return Ok(Ended::OneJob(end));
                    }
                    pauses.reset();
                    idle = Idle::new(self.max_idle);
                    continue;
                }
                Ok(None) if self.one_job && self.max_idle.is_none() => return Ok(Ended::Idle),
                Ok(None) => idle.answered(),
                // The coordinator no longer knows this worker.
                Err(status) if status.code() == Code::NotFound => name.clear(),
                Err(status) if is_transient(status.code()) => {
                    tracing::debug!(%status, "asking for work failed, trying again");
                    idle.failed(&status);
                }
                // A new call id, so that the coordinator does not repeat this lease.
                Err(status) if is_unreadable(status.code()) => {
                    tracing::error!(%status, "a lease can't be read");
                    call = Uuid::new_v4();
                }
                Err(status) => return Err(WorkerError::Refused(Box::new(status))),
            }
            if let Some(ended) = idle.end() {
                return ended;
            }
            let time = idle.at_most(pauses.pause());
            match told_of_none {
                true => self.wait(time, stopping).await,
                false => pause(time, stopping).await,
            }
        }
        Ok(Ended::Stopped)
    }

    /// This worker's name from the coordinator; none if shutdown comes first.
    async fn register(
        &self,
        stopping: &CancellationToken,
        idle: &mut Idle,
    ) -> Result<Option<String>, WorkerError> {
        let request = RegisterWorkerRequest {
            display_name: self.display_name.clone(),
            device: Some(self.device.info.clone()),
            kinds: self.kinds.iter().map(|&kind| kind.into()).collect(),
            embedded: self.embedded,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            order_level: orders::LEVEL,
            reads_films: self.ingest.pose_model.is_some() && self.kinds.contains(&JobKind::Ingest),
        };
        let mut backoff = Backoff::new(self.poll, self.idle_poll);
        let mut told = false;
        while !stopping.is_cancelled() {
            let mut client = self.client.clone();
            match answer(client.register_worker(request.clone())).await {
                Ok(registered) => {
                    tracing::info!(
                        worker = registered.worker,
                        device = self.device.info.adapter,
                        "registered"
                    );
                    tell_version(&registered);
                    return Ok(Some(registered.worker));
                }
                Err(status) if is_transient(status.code()) => {
                    if !told {
                        tracing::warn!(%status, "the coordinator can't be reached, trying until it can");
                        told = true;
                    }
                    idle.failed(&status);
                }
                Err(status) if status.code() == Code::Unimplemented => {
                    return Err(WorkerError::Protocol {
                        told: status.message().to_owned(),
                    });
                }
                Err(status) => return Err(WorkerError::Refused(Box::new(status))),
            }
            if let Some(ended) = idle.end() {
                return ended.map(|_| None);
            }
            pause(idle.at_most(backoff.pause()), stopping).await;
        }
        Ok(None)
    }

    /// Waits for `time`, or until the coordinator tells that a job was queued. One that can't tell costs no more than the time.
    async fn wait(&self, time: Duration, stopping: &CancellationToken) {
        let request = WaitForJobRequest {
            kinds: self.kinds.iter().map(|&kind| kind.into()).collect(),
            seconds: time.as_secs_f64(),
        };
        let mut client = self.client.clone();
        let queued = async {
            let answer = client.wait_for_job(request).await;
            answer.is_ok_and(|it| it.into_inner().queued)
        };
        tokio::select! {
            true = queued => {}
            () = pause(time, stopping) => {}
        }
    }

    async fn lease(&self, worker: &str, call: Uuid) -> Result<Option<Lease>, Status> {
        let mut client = self.client.clone();
        let request = LeaseJobRequest {
            worker: worker.into(),
            request_id: call.to_string(),
            help: true,
        };
        Ok(answer(client.lease_job(request)).await?.lease)
    }
}

/// One line if the coordinator is of another version, as far as orders differ.
fn tell_version(service: &RegisterWorkerResponse) {
    let (version, own) = (service.version.as_str(), env!("CARGO_PKG_VERSION"));
    match service.order_level.cmp(&orders::LEVEL) {
        Ordering::Equal => {}
        Ordering::Greater => tracing::warn!(
            service = version,
            worker = own,
            "this worker is of an earlier version than the service: orders that it does not understand wait for other workers"
        ),
        Ordering::Less => tracing::info!(
            service = version,
            worker = own,
            "this worker is of a later version than the service: it understands all of the service's orders"
        ),
    }
}

/// The answer of one call, or DEADLINE_EXCEEDED when it takes too long.
async fn answer<T>(
    call: impl Future<Output = Result<tonic::Response<T>, Status>>,
) -> Result<T, Status> {
    match timeout(CALL_TIMEOUT, call).await {
        Ok(answered) => answered.map(tonic::Response::into_inner),
        Err(_) => Err(Status::deadline_exceeded(
            "the coordinator did not answer in time",
        )),
    }
}

async fn pause(time: Duration, stopping: &CancellationToken) {
    tokio::select! {
        () = stopping.cancelled() => {}
        () = sleep(time) => {}
    }
}

fn seconds(field: &'static str, value: f64) -> Result<Duration, WorkerError> {
    Duration::try_from_secs_f64(value).map_err(|_| WorkerError::Config { field, value })
}

#[cfg(test)]
mod tests {
    use super::*;
    use object_store::memory::InMemory;
    use tonic::transport::Endpoint;

    fn worker(config: WorkerConfig) -> Result<Worker, WorkerError> {
        let channel = Endpoint::from_static("http://127.0.0.1:1").connect_lazy();
        let objects = Objects::over(Arc::new(InMemory::new()));
        Worker::with_objects(channel, objects, yoto_device::pick(), config)
    }

    #[tokio::test]
    async fn shutdown_ends_a_worker_that_never_reached_its_coordinator() {
        let worker = worker(WorkerConfig::default()).expect("a worker");
        let (stop, stopped) = tokio::sync::oneshot::channel::<()>();
        let running = tokio::spawn(worker.run(async { drop(stopped.await) }));
        stop.send(()).expect("still running");
        let ended = timeout(Duration::from_secs(30), running).await;
        ended
            .expect("in time")
            .expect("no panic")
            .expect("no error");
    }

    #[tokio::test]
    async fn a_pause_that_is_no_time_is_named() {
        let config = WorkerConfig {
            drain_seconds: f64::NAN,
            ..WorkerConfig::default()
        };
        let error = worker(config).err().expect("refused");
        assert!(error.to_string().contains("drain_seconds"), "{error}");
    }
}
