//! Leases: guarded writes, lost workers, ends of jobs. The clock is the tests' own.

mod losses;

use crate::support::{
    Service, Trained, assert_invalid, assert_refused, claim, id, job_error, job_name,
};
use std::sync::Arc;
use tonic::{Code, Status};
use yoto_proto::names::{Collection, parse_checkpoint};
use yoto_proto::v1::job_attempt::Outcome as Ended;
use yoto_proto::v1::{CancelJobRequest, IngestResult, Job, Progress, TrainResult, job, job_result};
use yoto_proto::worker::v1::end_job_request::{Cancelled, Outcome};
use yoto_proto::worker::v1::{HeartbeatRequest, Lease, LeaseJobRequest};
use yoto_server::clock::ManualClock;

/// Length of a lease, seconds.
const LEASE: f64 = 20.0;

const STALE: &str = "STALE_LEASE";

/// A service whose clock moves only when it is told to.
async fn start() -> (Service, Arc<ManualClock>) {
    let clock = Arc::new(ManualClock::at(1e9));
    let own = clock.clone();
    let service = Service::start_with(move |config| {
        config.clock = own;
        config.lease_seconds = LEASE;
        config.max_lost_workers = 3;
    })
    .await;
    (service, clock)
}

/// Moves the clock in steps too short for an outage, and lets the service check its leases.
async fn pass(service: &Service, clock: &ManualClock, seconds: f64) {
    let mut left = seconds;
    while left > 0.0 {
        let step = left.min(LEASE / 4.0);
        clock.advance(step);
        service
            .coordinator
            .look_after_leases()
            .await
            .expect("looks");
        left -= step;
    }
}

async fn heartbeat(service: &Service, lease: &Lease, step: u64) -> Result<bool, Status> {
    let progress = Some(Progress {
        phase: "training".into(),
        step,
        steps_per_second: 7.0,
        ..<_>::default()
    });
    let request = HeartbeatRequest {
        claim: Some(claim(lease)),
        progress,
    };
    let answer = service.workers().heartbeat(request).await;
    answer.map(|answer| answer.into_inner().cancel)
}

async fn cancel(service: &Service, job: &str) -> Job {
    let request = CancelJobRequest {
        name: job.into(),
        request_id: "once".into(),
    };
    let answer = service.jobs().cancel_job(request).await;
    answer.expect("is heard").into_inner()
}

async fn train_result(service: &Service, lease: &Lease, step: u64) -> job_result::Kind {
    let checkpoint = service.publish(lease, step).await.expect("publishes").name;
    job_result::Kind::Train(TrainResult {
        checkpoint,
        steps: step,
        ..<_>::default()
    })
}

async fn training(service: &Service) -> Job {
    let subject = service.ready_subject("Ada").await;
    service.train(&service.model_of(&subject).await).await
}

/// The outcome of each attempt of a job.
async fn history(service: &Service, job: &str) -> Vec<Ended> {
    let attempts = service.get_job(job).await.attempts;
    attempts.iter().map(|it| it.outcome()).collect()
}

#[tokio::test]
async fn a_training_is_leased_reported_and_completed() {
    let service = Service::start().await;
    let subject = service.ready_subject("Ada").await;
    let model = service.model_of(&subject).await;
    let job = service.train(&model).await;
    assert_eq!((job.state(), job.sequence), (job::State::Queued, 1));
    let renderer = service.worker(&["render"]).await;
    assert_eq!(service.lease(&renderer).await, None, "it does not train");

    let trainer = service.worker(&["train", "render"]).await;
    let lease = service.lease(&trainer).await.expect("the training waits");
    assert_eq!(job_name(&lease), job.name);
    let inputs = lease.inputs.clone().expect("has inputs");
    assert_eq!(inputs.model, Some(model));
    assert_eq!(inputs.shards.len(), 1);
    assert_eq!(inputs.shards[0].subject, subject.name);
    let cancelled = heartbeat(&service, &lease, 3).await;
    assert!(!cancelled.expect("holds the lease"));
    let running = service.get_job(&job.name).await;
    let seen = (running.state(), running.worker);
    assert_eq!(seen, (job::State::Running, trainer.clone()));
    assert_eq!(running.progress.expect("has progress").step, 3);

    let unpublished = TrainResult {
        checkpoint: "models/x/checkpoints/9".into(),
        ..<_>::default()
    };
    let answer = service.complete(&lease, job_result::Kind::Train(unpublished));
    assert_invalid(answer.await, "result.train.checkpoint");
    let ingest = job_result::Kind::Ingest(IngestResult::default());
    assert_invalid(service.complete(&lease, ingest).await, "result");
    let result = train_result(&service, &lease, 10).await;
    let answer = service.complete(&lease, result.clone()).await;
    answer.expect("completes");
    let done = service.get_job(&job.name).await;
    assert_eq!(done.state(), job::State::Succeeded);
    assert!(done.end_time.is_some() && done.start_time.is_some());
    assert_eq!(history(&service, &job.name).await, [Ended::Succeeded]);

    // A repeated call gets the answer of the first, another end is refused.
    let repeated = service.complete(&lease, result).await;
    repeated.expect("is a repetition");
    let failed = Outcome::Failed(job_error("INTERNAL", "after all"));
    let answer = service.end(&lease, failed).await;
    assert_refused(answer, Code::FailedPrecondition, STALE);
    let again = heartbeat(&service, &lease, 4).await;
    assert_refused(again, Code::FailedPrecondition, STALE);
    let request = LeaseJobRequest {
        worker: "workers/none".into(),
        request_id: String::new(),
        help: false,
    };
    let answer = service.workers().lease_job(request).await;
    assert_refused(answer, Code::NotFound, "NOT_FOUND");
}

#[tokio::test]
async fn a_heartbeat_keeps_the_lease() {
    let (service, clock) = start().await;
    let job = training(&service).await;
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("the training waits");
    for step in 1..=4 {
        pass(&service, &clock, 0.9 * LEASE).await;
        let kept = heartbeat(&service, &lease, step).await;
        kept.expect("holds the lease");
    }
    assert_eq!(service.get_job(&job.name).await.lost_workers, 0);
}

#[tokio::test]
async fn a_queued_job_is_cancelled_at_once_and_a_running_one_by_its_worker() {
    let service = Service::start().await;
    let subject = service.ready_subject("Ada").await;
    let model = service.model_of(&subject).await;
    let queued = service.train(&model).await;
    let cancelled = cancel(&service, &queued.name).await;
    let seen = (cancelled.state(), cancelled.sequence);
    assert_eq!(seen, (job::State::Cancelled, 2));
    assert_eq!(cancel(&service, &queued.name).await, cancelled);
    let worker = service.worker(&["train"]).await;
    assert_eq!(service.lease(&worker).await, None);

    service.train(&model).await;
    let lease = service.lease(&worker).await.expect("the training waits");
    let stopped = || Outcome::Cancelled(Cancelled {});
    let answer = service.end(&lease, stopped()).await;
    assert_refused(answer, Code::FailedPrecondition, "CANCEL_NOT_REQUESTED");
    // The request id belongs to the other job.
    let request = CancelJobRequest {
        name: job_name(&lease),
        request_id: "once".into(),
    };
    let answer = service.jobs().cancel_job(request).await;
    assert_refused(answer, Code::AlreadyExists, "REQUEST_ID_REUSED");
    let request = CancelJobRequest {
        name: job_name(&lease),
        request_id: "another".into(),
    };
    let marked = service.jobs().cancel_job(request).await.expect("is heard");
    let marked = marked.into_inner();
    let seen = (marked.state(), marked.cancel_requested);
    assert_eq!(seen, (job::State::Running, true));
    let told = heartbeat(&service, &lease, 1).await;
    assert!(told.expect("holds the lease"));
    service.end(&lease, stopped()).await.expect("is recorded");
    let ended = service.get_job(&job_name(&lease)).await;
    assert_eq!(ended.state(), job::State::Cancelled);
}

#[tokio::test]
async fn a_lease_whose_answer_was_lost_is_found_again() {
    let (service, clock) = start().await;
    training(&service).await;
    training(&service).await;
    let worker = service.worker(&["train"]).await;
    let first = service.lease_by(&worker, "call 1").await;
    clock.advance(0.4 * LEASE);
    let again = service.lease_by(&worker, "call 1").await;
    assert_eq!(again, first);
    let lease = first.expect("a training waits");
    // The worker counts its lease from the call that was answered.
    pass(&service, &clock, 0.9 * LEASE).await;
    heartbeat(&service, &lease, 1)
        .await
        .expect("holds the lease");
    let other = service.lease_by(&worker, "call 2").await;
    assert_ne!(job_name(&other.expect("the other one")), job_name(&lease));
    let stranger = service.worker(&["train"]).await;
    assert_eq!(service.lease_by(&stranger, "call 1").await, None);
}

#[tokio::test]
async fn a_fault_of_a_resource_is_told_while_the_job_waits() {
    let (service, clock) = start().await;
    let job = training(&service).await;
    let worker = service.worker(&["train"]).await;
    let full = job_error("MACHINE", "the disk is full");
    let lease = service.lease(&worker).await.expect("the training waits");
    let postponed = Outcome::Postponed(full.clone());
    service.end(&lease, postponed).await.expect("is recorded");
    let waiting = service.get_job(&job.name).await;
    assert_eq!(waiting.state(), job::State::Queued);
    assert_eq!((&waiting.waiting, &waiting.error), (&Some(full), &None));
    assert!(waiting.retry_time.is_some());
    assert_eq!(service.lease(&worker).await, None, "not at once");
    clock.advance(1.3);
    service.lease(&worker).await.expect("a second is over");
    let running = service.get_job(&job.name).await;
    assert_eq!((running.waiting, running.retry_time), (None, None));
    let ended = [Ended::Postponed, Ended::Running];
    assert_eq!(history(&service, &job.name).await, ended);
}

#[tokio::test]
async fn a_lease_that_no_worker_can_read_ends_its_job() {
    let service = Service::start().await;
    let Trained {
        subject,
        model,
        worker,
        ..
    } = service.trained().await;
    let [long, next] = [(); 2].map(|()| service.render(&model, &subject, ""));
    let (long, next) = (long.await, next.await);
    // Rows from an earlier version without limits: 60,000 files with names of 600 bytes.
    let files = |name| {
        format!(
            "WITH RECURSIVE n (i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 60000)
         INSERT INTO job_outputs (job, file, key, bytes, sha256)
         SELECT '{}', {name}, 'key', 1, '' FROM n",
            id(&long.name)
        )
    };
    let (sqlite, postgres) = (
        files("printf('%0600d', i)"),
        files("lpad(i::text, 600, '0')"),
    );
    service.database.run_either(&sqlite, &postgres).await;
    assert!(service.lease(&worker).await.is_none());
    let ended = service.get_job(&long.name).await;
    assert_eq!(ended.state(), job::State::Failed);
    assert_eq!(ended.error.expect("has a reason").code, "TOO_LARGE");
    let lease = service.lease(&worker).await.expect("the next one waits");
    assert_eq!(job_name(&lease), next.name);
}

#[tokio::test]
async fn tokens_can_t_be_read_or_guessed_from_a_job() {
    let service = Service::start().await;
    let subject = service.ready_subject("Ada").await;
    let job = service.train(&service.model_of(&subject).await).await;
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("the training waits");
    let checkpoint = service.publish(&lease, 1).await.expect("publishes");
    let seen = service.get_job(&job.name).await;
    let attempt = seen.attempts.last().expect("has one");
    assert_eq!((attempt.number, &attempt.worker), (1, &worker));
    let (model, _) = parse_checkpoint(&checkpoint.name).expect("a name");
    let listed = service.checkpoints(&Collection::Models.name(model)).await;
    let token = lease.token.to_string();
    for text in [format!("{seen:?}"), format!("{listed:?}")] {
        assert!(!text.contains(&token), "{text}");
    }
    let mut guessed = lease.clone();
    guessed.token = attempt.number;
    let outcome = Outcome::Failed(job_error("X", "owned"));
    let refused = service.end(&guessed, outcome).await;
    assert_refused(refused, Code::FailedPrecondition, "STALE_LEASE");
    let again = service.get_job(&job.name).await;
    assert_eq!(again.state(), job::State::Running);
}
