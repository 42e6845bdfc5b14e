//! Leases: guarded writes, lost workers, ends of jobs.

mod support;

use support::{Service, assert_invalid, assert_refused, eventually, job_name};
use tonic::{Code, Status};
use yoto_proto::v1::{
    CancelJobRequest, FailJobRequest, HeartbeatRequest, IngestResult, Job, Lease, LeaseJobRequest,
    Progress, TrainResult, capture, job, job_result,
};

/// A lease that expires during a test, seconds; long enough for a few calls on a busy machine.
const SHORT_LEASE: f64 = 1.0;

async fn heartbeat(service: &Service, lease: &Lease, step: u64) -> Result<bool, Status> {
    let progress = Some(Progress {
        phase: "training".into(),
        step,
        ..<_>::default()
    });
    let request = HeartbeatRequest {
        job: job_name(lease),
        token: lease.token,
        progress,
    };
    service
        .workers()
        .heartbeat(request)
        .await
        .map(|answer| answer.into_inner().cancel)
}

async fn cancel(service: &Service, job: &str) -> Job {
    let request = CancelJobRequest { name: job.into() };
    service
        .jobs()
        .cancel_job(request)
        .await
        .expect("is heard")
        .into_inner()
}

async fn give_up(
    service: &Service,
    lease: &Lease,
    change: impl FnOnce(&mut FailJobRequest),
) -> Result<(), Status> {
    let mut request = FailJobRequest {
        job: job_name(lease),
        token: lease.token,
        ..<_>::default()
    };
    change(&mut request);
    service.workers().fail_job(request).await.map(drop)
}

async fn train_result(service: &Service, lease: &Lease, step: u64) -> job_result::Kind {
    let checkpoint = service.publish(lease, step).await.expect("publishes").name;
    job_result::Kind::Train(TrainResult {
        checkpoint,
        steps: step,
        ..<_>::default()
    })
}

#[tokio::test]
async fn a_training_is_leased_reported_and_completed() {
    let service = Service::start().await;
    let subject = service.ready_subject("Ada").await;
    let model = service.model_of(&subject).await;
    let job = service.train(&model).await;
    assert_eq!(
        (job.state(), job.sequence, job.lease),
        (job::State::Queued, 1, 0)
    );
    let renderer = service.worker(&["render"]).await;
    assert_eq!(service.lease(&renderer).await, None, "it does not train");

    let trainer = service.worker(&["train", "render"]).await;
    let lease = service.lease(&trainer).await.expect("the training waits");
    assert_eq!((job_name(&lease), lease.token), (job.name.clone(), 1));
    let inputs = lease.inputs.clone().expect("has inputs");
    assert_eq!(inputs.model, Some(model));
    assert_eq!(inputs.shards.len(), 1);
    assert_eq!(inputs.shards[0].subject, subject.name);
    assert!(
        !heartbeat(&service, &lease, 3)
            .await
            .expect("holds the lease")
    );
    let running = service.get_job(&job.name).await;
    assert_eq!(
        (running.state(), running.worker),
        (job::State::Running, trainer.clone())
    );
    assert_eq!(running.progress.expect("has progress").step, 3);

    let unpublished = TrainResult {
        checkpoint: "models/x/checkpoints/9".into(),
        ..<_>::default()
    };
    let answer = service
        .complete(&lease, job_result::Kind::Train(unpublished))
        .await;
    assert_invalid(answer, "result.train.checkpoint");
    let ingest = job_result::Kind::Ingest(IngestResult::default());
    assert_invalid(service.complete(&lease, ingest).await, "result");
    let result = train_result(&service, &lease, 10).await;
    service
        .complete(&lease, result.clone())
        .await
        .expect("completes");
    let done = service.get_job(&job.name).await;
    assert_eq!(done.state(), job::State::Succeeded);
    assert!(done.end_time.is_some() && done.start_time.is_some());
    let answer = service.complete(&lease, result).await;
    assert_refused(answer, Code::FailedPrecondition, "STALE_LEASE");
    let again = heartbeat(&service, &lease, 4).await;
    assert_refused(again, Code::FailedPrecondition, "STALE_LEASE");
    let request = LeaseJobRequest {
        worker: "workers/none".into(),
    };
    assert_refused(
        service.workers().lease_job(request).await,
        Code::NotFound,
        "NOT_FOUND",
    );
}

#[tokio::test]
async fn a_lost_lease_is_taken_over_and_every_late_write_refused() {
    let service = Service::start_with(|config| config.lease_seconds = SHORT_LEASE).await;
    let subject = service.ready_subject("Ada").await;
    let model = service.model_of(&subject).await;
    let job = service.train(&model).await;
    let lost = service.worker(&["train"]).await;
    let old = service.lease(&lost).await.expect("the training waits");
    service.publish(&old, 5).await.expect("publishes in time");

    let heir = service.worker(&["train"]).await;
    let new = service.lease_eventually(&heir).await;
    assert_eq!((job_name(&new), new.token), (job.name.clone(), 2));
    let resume = new.inputs.clone().expect("has inputs").checkpoints;
    assert_eq!(
        resume.iter().map(|found| found.step).collect::<Vec<_>>(),
        [5]
    );
    assert!(service.get_job(&job.name).await.lost_workers >= 1);

    let stale = "STALE_LEASE";
    assert_refused(
        heartbeat(&service, &old, 9).await,
        Code::FailedPrecondition,
        stale,
    );
    assert_refused(
        service.publish(&old, 9).await,
        Code::FailedPrecondition,
        stale,
    );
    let result = job_result::Kind::Train(TrainResult::default());
    assert_refused(
        service.complete(&old, result).await,
        Code::FailedPrecondition,
        stale,
    );
    let answer = give_up(&service, &old, |request| request.requeue = true).await;
    assert_refused(answer, Code::FailedPrecondition, stale);
    let future = Lease {
        token: u64::MAX,
        ..new.clone()
    };
    assert_refused(
        heartbeat(&service, &future, 9).await,
        Code::FailedPrecondition,
        stale,
    );

    // Whether or not the heir's short lease has run out as well, no late write got through.
    let job = service.get_job(&job.name).await;
    assert!(job.lease >= 2 && job.progress.is_none(), "{job:?}");
    assert!(job.result.is_none() && job.end_time.is_none(), "{job:?}");
}

#[tokio::test]
async fn a_heartbeat_keeps_the_lease() {
    let service = Service::start_with(|config| config.lease_seconds = 2.0).await;
    let subject = service.ready_subject("Ada").await;
    let job = service.train(&service.model_of(&subject).await).await;
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("the training waits");
    let begun = tokio::time::Instant::now();
    let mut step = 0;
    while begun.elapsed().as_secs_f64() < 4.5 {
        step += 1;
        heartbeat(&service, &lease, step)
            .await
            .expect("holds the lease");
        tokio::time::sleep(std::time::Duration::from_millis(20)).await;
    }
    let job = service.get_job(&job.name).await;
    assert_eq!((job.lost_workers, job.lease), (0, 1));
}

#[tokio::test]
async fn a_job_that_loses_too_many_workers_fails_and_its_capture_can_be_read_again() {
    let service = Service::start_with(|config| {
        config.lease_seconds = 0.05;
        config.max_lost_workers = 3;
    })
    .await;
    let subject = service.subject("Ada").await;
    let uploaded = service.upload_good(&subject.name).await;
    let worker = service.worker(&["ingest"]).await;
    for token in 1..=3 {
        assert_eq!(service.lease_eventually(&worker).await.token, token);
    }
    let ended = || async {
        let job = service.get_job(&uploaded.ingest_job).await;
        (job.state() == job::State::Failed).then_some(job)
    };
    let job = eventually("the end", ended).await;
    assert_eq!(job.lost_workers, 3);
    assert_eq!(job.error.expect("says why").code, "WORKERS_LOST");
    assert_eq!(service.lease(&worker).await, None);
    let capture = service.get_capture(&uploaded.name).await;
    assert_eq!(capture.state(), capture::State::Uploaded);
    assert_eq!(capture.violations, []);
}

#[tokio::test]
async fn a_queued_job_is_cancelled_at_once_and_a_running_one_by_its_worker() {
    let service = Service::start().await;
    let subject = service.ready_subject("Ada").await;
    let model = service.model_of(&subject).await;
    let queued = service.train(&model).await;
    let cancelled = cancel(&service, &queued.name).await;
    assert_eq!(
        (cancelled.state(), cancelled.sequence),
        (job::State::Cancelled, 2)
    );
    assert_eq!(
        cancel(&service, &queued.name).await,
        cancelled,
        "once is enough"
    );
    let worker = service.worker(&["train"]).await;
    assert_eq!(service.lease(&worker).await, None);

    service.train(&model).await;
    let lease = service.lease(&worker).await.expect("the training waits");
    let answer = give_up(&service, &lease, |request| request.cancelled = true).await;
    assert_refused(answer, Code::FailedPrecondition, "CANCEL_NOT_REQUESTED");
    let marked = cancel(&service, &job_name(&lease)).await;
    assert_eq!(
        (marked.state(), marked.cancel_requested),
        (job::State::Running, true)
    );
    assert!(
        heartbeat(&service, &lease, 1)
            .await
            .expect("holds the lease")
    );
    give_up(&service, &lease, |request| request.cancelled = true)
        .await
        .expect("is recorded");
    assert_eq!(
        service.get_job(&job_name(&lease)).await.state(),
        job::State::Cancelled
    );
}

#[tokio::test]
async fn a_cancelled_job_whose_worker_is_lost_does_not_run_again() {
    let service = Service::start_with(|config| config.lease_seconds = SHORT_LEASE).await;
    let subject = service.ready_subject("Ada").await;
    let job = service.train(&service.model_of(&subject).await).await;
    let worker = service.worker(&["train"]).await;
    service.lease(&worker).await.expect("the training waits");
    cancel(&service, &job.name).await;
    let ended = || async {
        let job = service.get_job(&job.name).await;
        (job.state() == job::State::Cancelled).then_some(job)
    };
    assert_eq!(eventually("the end", ended).await.lost_workers, 1);
    assert_eq!(service.lease(&worker).await, None);
}

#[tokio::test]
async fn a_model_has_one_trainer_at_a_time_and_a_job_given_back_keeps_its_place() {
    let service = Service::start().await;
    let subject = service.ready_subject("Ada").await;
    let one = service.model_of(&subject).await;
    let first = service.train(&one).await;
    let second = service.train(&one).await;
    assert_eq!(service.get_job(&second.name).await.queue_position, 1);
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("the first waits");
    assert_eq!(job_name(&lease), first.name);
    assert_eq!(
        service.lease(&worker).await,
        None,
        "the model is being trained"
    );
    let other = service.train(&service.model_of(&subject).await).await;
    let beside = service
        .lease(&worker)
        .await
        .expect("another model may be trained");
    assert_eq!(job_name(&beside), other.name);

    give_up(&service, &lease, |request| request.requeue = true)
        .await
        .expect("is given back");
    let back = service.get_job(&first.name).await;
    assert_eq!((back.state(), back.lost_workers), (job::State::Queued, 0));
    let lease = service.lease(&worker).await.expect("the first waits again");
    assert_eq!((job_name(&lease), lease.token), (first.name, 2));
    let result = train_result(&service, &lease, 1).await;
    service.complete(&lease, result).await.expect("completes");
    let lease = service.lease(&worker).await.expect("now the second");
    assert_eq!(job_name(&lease), second.name);
}

#[tokio::test(flavor = "multi_thread")]
async fn workers_that_ask_at_once_never_get_the_same_job() {
    let service = Service::start().await;
    let mut queued = Vec::new();
    for n in 0..6 {
        let subject = service.subject(&format!("person {n}")).await;
        queued.push(service.upload_good(&subject.name).await.ingest_job);
    }
    let worker = service.worker(&["ingest"]).await;
    let asked = (0..20).map(|_| service.lease(&worker));
    let leases = futures::future::join_all(asked).await;
    let mut leased: Vec<_> = leases.iter().flatten().map(job_name).collect();
    leased.sort();
    queued.sort();
    assert_eq!(leased, queued);
}
