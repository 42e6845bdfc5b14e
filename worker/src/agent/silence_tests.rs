//! Tests of a worker whose coordinator answers nothing until a lease has expired, or has no job at first.

use super::*;
use object_store::memory::InMemory;
use object_store::throttle::{ThrottleConfig, ThrottledStore};
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;
use tokio::net::TcpListener;
use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use tonic::transport::Server;
use tonic::transport::server::TcpIncoming;
use tonic::{Request, Response};
use yoto_proto::v1::{IngestSpec, Job, JobSpec, ObjectRef, job_spec};
use yoto_proto::worker::v1::end_job_request::Outcome;
use yoto_proto::worker::v1::worker_service_server::{WorkerService, WorkerServiceServer};
use yoto_proto::worker::v1::{
    CommitOutputRequest, CommitOutputResponse, EndJobRequest, EndJobResponse, HeartbeatRequest,
    HeartbeatResponse, InputFile, InputPiece, Inputs, LeaseJobResponse, PublishCheckpointRequest,
    PublishCheckpointResponse, RegisterWorkerResponse, TakeRangeRequest, TakeRangeResponse,
    WaitForJobResponse,
};

/// Time in which an object would be read: no job ends by itself meanwhile.
const UNREAD: Duration = Duration::from_secs(3600);

/// A coordinator that leases one job, and refuses all reports on it as UNAVAILABLE for the time of the lease.
struct Locked {
    /// Whether the job is queued only once the worker waits for one.
    later: AtomicBool,
    lease: Mutex<Option<Lease>>,
    until: Mutex<Option<Instant>>,
    lease_time: Duration,
    ended: mpsc::UnboundedSender<Outcome>,
}

impl Locked {
    fn check(&self) -> Result<(), Status> {
        let until = self.until.lock().expect("no panic");
        match *until {
            Some(until) if Instant::now() > until => Ok(()),
            _ => Err(Status::unavailable("the database is locked")),
        }
    }
}

type Answer<T> = Result<Response<T>, Status>;

#[tonic::async_trait]
impl WorkerService for Locked {
    async fn register_worker(
        &self,
        _: Request<RegisterWorkerRequest>,
    ) -> Answer<RegisterWorkerResponse> {
        let worker = "workers/a".to_owned();
        Ok(Response::new(RegisterWorkerResponse {
            worker,
            ..RegisterWorkerResponse::default()
        }))
    }

    async fn lease_job(&self, _: Request<LeaseJobRequest>) -> Answer<LeaseJobResponse> {
        if self.later.load(Relaxed) {
            return Ok(Response::new(LeaseJobResponse::default()));
        }
        let lease = self.lease.lock().expect("no panic").take();
        if lease.is_some() {
            let until = Instant::now() + self.lease_time;
            *self.until.lock().expect("no panic") = Some(until);
        }
        Ok(Response::new(LeaseJobResponse { lease }))
    }

    async fn wait_for_job(&self, _: Request<WaitForJobRequest>) -> Answer<WaitForJobResponse> {
        let queued = self.later.swap(false, Relaxed);
        Ok(Response::new(WaitForJobResponse { queued }))
    }

    async fn heartbeat(&self, _: Request<HeartbeatRequest>) -> Answer<HeartbeatResponse> {
        self.check()?;
        Ok(Response::new(HeartbeatResponse::default()))
    }

    async fn publish_checkpoint(
        &self,
        _: Request<PublishCheckpointRequest>,
    ) -> Answer<PublishCheckpointResponse> {
        Err(Status::unimplemented(""))
    }

    async fn commit_output(&self, _: Request<CommitOutputRequest>) -> Answer<CommitOutputResponse> {
        Err(Status::unimplemented(""))
    }

    async fn take_range(&self, _: Request<TakeRangeRequest>) -> Answer<TakeRangeResponse> {
        Err(Status::unimplemented(""))
    }

    async fn end_job(&self, request: Request<EndJobRequest>) -> Answer<EndJobResponse> {
        self.check()?;
        if let Some(outcome) = request.into_inner().outcome {
            let _ = self.ended.send(outcome);
        }
        Ok(Response::new(EndJobResponse::default()))
    }
}

/// The outcome that a worker reports after a lease of `lease_time` without an answer.
async fn outcome(kind: Option<job_spec::Kind>, inputs: Inputs, lease_time: Duration) -> Outcome {
    let config = WorkerConfig::default();
    let (outcome, working) = worked(kind, inputs, lease_time, config, false).await;
    working.abort();
    outcome
}

/// The same of a worker with these settings, and its task. The job may come `later` than the worker.
async fn worked(
    kind: Option<job_spec::Kind>,
    inputs: Inputs,
    lease_time: Duration,
    config: WorkerConfig,
    later: bool,
) -> (Outcome, JoinHandle<Result<Ended, WorkerError>>) {
    let (ended, mut outcomes) = mpsc::unbounded_channel();
    let lease = Lease {
        job: Some(Job {
            name: "jobs/1".into(),
            spec: Some(JobSpec { kind }),
            ..Job::default()
        }),
        token: 1,
        lease_seconds: lease_time.as_secs_f64(),
        inputs: Some(inputs),
        helps: false,
    };
    let locked = Locked {
        later: AtomicBool::new(later),
        lease: Mutex::new(Some(lease)),
        until: Mutex::new(None),
        lease_time,
        ended,
    };
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("binds");
    let address = listener.local_addr().expect("has an address");
    let serving = Server::builder()
        .add_service(WorkerServiceServer::new(locked))
        .serve_with_incoming(TcpIncoming::from(listener));
    let serving = tokio::spawn(serving);
    let endpoint = tonic::transport::Endpoint::from_shared(format!("http://{address}"));
    let channel = endpoint.expect("an address").connect_lazy();
    let slow = ThrottleConfig {
        wait_get_per_call: UNREAD,
        ..ThrottleConfig::default()
    };
    let objects = Objects::over(Arc::new(ThrottledStore::new(InMemory::new(), slow)));
    let worker = Worker::with_objects(channel, objects, yoto_device::pick(), config);
    let working = tokio::spawn(worker.expect("a worker").run(std::future::pending()));
    let told = timeout(Duration::from_secs(60), outcomes.recv()).await;
    let told = told.expect("in time").expect("an outcome");
    // The coordinator serves until the test ends: its answer has to reach the worker.
    drop(serving);
    (told, working)
}

#[tokio::test(flavor = "multi_thread")]
async fn an_outcome_survives_a_coordinator_that_answers_nothing_for_a_lease() {
    // A job without an order fails at once.
    let told = outcome(None, Inputs::default(), Duration::from_millis(300)).await;
    assert!(
        matches!(&told, Outcome::Failed(error) if error.code == "INVALID_SPEC"),
        "{told:?}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_that_stopped_without_an_answer_is_returned() {
    let spec = IngestSpec {
        capture: "captures/c".into(),
    };
    let piece = InputPiece {
        bytes: 1,
        ..InputPiece::default()
    };
    let part = ObjectRef {
        key: "part".into(),
        bytes: 1,
        ..ObjectRef::default()
    };
    let inputs = Inputs {
        files: vec![InputFile {
            path: "poses.json".into(),
            bytes: 1,
            pieces: vec![piece],
            ..InputFile::default()
        }],
        parts: vec![part],
        ..Inputs::default()
    };
    let kind = Some(job_spec::Kind::Ingest(spec));
    // The worker reports for a number of leases: one of no time would leave none for the call.
    let told = outcome(kind, inputs, Duration::from_millis(300)).await;
    assert!(matches!(told, Outcome::Returned(_)), "{told:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_worker_for_one_job_tells_that_it_failed() {
    let config = WorkerConfig {
        one_job: true,
        ..WorkerConfig::default()
    };
    // A job without an order fails at once.
    let lease = Duration::from_millis(300);
    let (_, working) = worked(None, Inputs::default(), lease, config, false).await;
    let ended = timeout(Duration::from_secs(60), working).await;
    let ended = ended.expect("in time").expect("no panic");
    assert_eq!(ended.expect("no error"), Ended::OneJob(JobEnd::Failed));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_worker_that_waits_asks_as_soon_as_a_job_is_queued() {
    let never = 3600.0;
    let config = WorkerConfig {
        poll_seconds: never,
        idle_poll_seconds: never,
        ..WorkerConfig::default()
    };
    let lease = Duration::from_millis(300);
    let (_, working) = worked(None, Inputs::default(), lease, config, true).await;
    working.abort();
}
