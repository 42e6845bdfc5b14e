//! Lost workers, and outages of the service, which charge nobody.

use super::{LEASE, STALE, cancel, heartbeat, history, pass, start, training};
use crate::support::{Service, assert_refused, job_name};
use tonic::Code;
use yoto_proto::v1::job_attempt::Outcome as Ended;
use yoto_proto::v1::{TrainResult, capture, job, job_result};
use yoto_proto::worker::v1::Lease;
use yoto_proto::worker::v1::end_job_request::{Outcome, Returned};

#[tokio::test]
async fn a_lost_lease_is_taken_over_and_every_late_write_refused() {
    let (service, clock) = start().await;
    let job = training(&service).await;
    let lost = service.worker(&["train"]).await;
    let old = service.lease(&lost).await.expect("the training waits");
    service.publish(&old, 5).await.expect("publishes in time");
    heartbeat(&service, &old, 5).await.expect("in time");

    pass(&service, &clock, 0.9 * LEASE).await;
    let heir = service.worker(&["train"]).await;
    assert_eq!(service.lease(&heir).await, None, "it may only be late");
    pass(&service, &clock, 0.2 * LEASE).await;
    let waiting = service.get_job(&job.name).await;
    let progress = waiting.progress.expect("what it had reached");
    assert_eq!((progress.step, progress.steps_per_second), (5, 0.0));
    let new = service.lease(&heir).await.expect("waits again");
    assert_eq!(job_name(&new), job.name);
    assert!(new.token > old.token);
    let resume = new.inputs.clone().expect("has inputs").checkpoints;
    let steps: Vec<u64> = resume.iter().map(|found| found.step).collect();
    assert_eq!(steps, [5]);
    assert_eq!(service.get_job(&job.name).await.lost_workers, 1);

    let future = Lease {
        token: u64::MAX,
        ..new.clone()
    };
    // The right token from another worker.
    let mut stolen = new.clone();
    stolen.job = old.job.clone();
    for late in [&old, &future, &stolen] {
        let refused = |answer| assert_refused(answer, Code::FailedPrecondition, STALE);
        refused(heartbeat(&service, late, 9).await.map(drop));
        refused(service.publish(late, 9).await.map(drop));
        let result = job_result::Kind::Train(TrainResult::default());
        refused(service.complete(late, result).await);
        refused(service.end(late, Outcome::Returned(Returned {})).await);
    }
    let job = service.get_job(&job.name).await;
    assert_eq!(job.progress.clone().expect("the old one").step, 5);
    assert!(job.result.is_none() && job.end_time.is_none(), "{job:?}");
    assert_eq!(
        history(&service, &job.name).await,
        [Ended::Lost, Ended::Running]
    );
}

#[tokio::test]
async fn an_outage_charges_no_worker() {
    let (service, clock) = start().await;
    let job = training(&service).await;
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("the training waits");
    pass(&service, &clock, 0.5 * LEASE).await;
    // The machine slept, the coordinator was down, or the clock was set.
    for step in [3600.0, -7200.0, 86_400.0] {
        clock.advance(step);
        service
            .coordinator
            .look_after_leases()
            .await
            .expect("looks");
        assert_eq!(
            service.get_job(&job.name).await.state(),
            job::State::Running
        );
        heartbeat(&service, &lease, 1)
            .await
            .expect("holds the lease");
        pass(&service, &clock, 0.4 * LEASE).await;
    }
    assert_eq!(service.get_job(&job.name).await.lost_workers, 0);
    // But a worker that does not return loses its job within a lease.
    pass(&service, &clock, 1.1 * LEASE).await;
    assert_eq!(service.get_job(&job.name).await.state(), job::State::Queued);
}

#[tokio::test]
async fn an_outage_is_known_after_a_restart() {
    let (service, clock) = start().await;
    let job = training(&service).await;
    let worker = service.worker(&["train"]).await;
    service.lease(&worker).await.expect("the training waits");
    pass(&service, &clock, 0.5 * LEASE).await;
    let dir = service.stop().await;
    clock.advance(50.0 * LEASE);
    let own = clock.clone();
    let service = Service::start_in(dir, move |config| {
        config.clock = own;
        config.lease_seconds = LEASE;
    })
    .await;
    service
        .coordinator
        .look_after_leases()
        .await
        .expect("looks");
    assert_eq!(
        service.get_job(&job.name).await.state(),
        job::State::Running
    );
    pass(&service, &clock, 0.6 * LEASE).await;
    assert_eq!(service.get_job(&job.name).await.state(), job::State::Queued);
}

#[tokio::test]
async fn a_job_that_loses_too_many_workers_fails_and_its_capture_can_be_read_again() {
    let (service, clock) = start().await;
    let subject = service.subject("Ada").await;
    let uploaded = service.upload_good(&subject.name).await;
    let worker = service.worker(&["ingest"]).await;
    let mut last = 0;
    for _ in 1..=3 {
        let lease = service.lease(&worker).await.expect("it waits");
        assert!(lease.token > last);
        last = lease.token;
        pass(&service, &clock, 1.1 * LEASE).await;
    }
    let job = service.get_job(&uploaded.ingest_job).await;
    assert_eq!((job.state(), job.lost_workers), (job::State::Failed, 3));
    assert_eq!(job.error.expect("says why").code, "WORKERS_LOST");
    assert_eq!(history(&service, &job.name).await, [Ended::Lost; 3]);
    assert_eq!(service.lease(&worker).await, None);
    let capture = service.get_capture(&uploaded.name).await;
    assert_eq!(capture.state(), capture::State::Uploaded);
    assert_eq!(capture.violations, []);
}

#[tokio::test]
async fn losses_before_a_checkpoint_are_forgiven() {
    let (service, clock) = start().await;
    let job = training(&service).await;
    let worker = service.worker(&["train"]).await;
    for step in 1..=5 {
        let lease = service.lease(&worker).await.expect("it goes on");
        service.publish(&lease, step).await.expect("publishes");
        pass(&service, &clock, 1.1 * LEASE).await;
    }
    let going_on = service.get_job(&job.name).await;
    assert_eq!(
        (going_on.state(), going_on.lost_workers),
        (job::State::Queued, 5)
    );
    for _ in 0..2 {
        service.lease(&worker).await.expect("it goes on");
        pass(&service, &clock, 1.1 * LEASE).await;
    }
    let job = service.get_job(&job.name).await;
    assert_eq!(
        job.state(),
        job::State::Failed,
        "three in a row came no further"
    );
}

#[tokio::test]
async fn a_cancelled_job_whose_worker_is_lost_does_not_run_again() {
    let (service, clock) = start().await;
    let job = training(&service).await;
    let worker = service.worker(&["train"]).await;
    service.lease(&worker).await.expect("the training waits");
    cancel(&service, &job.name).await;
    pass(&service, &clock, 1.1 * LEASE).await;
    let ended = service.get_job(&job.name).await;
    assert_eq!(
        (ended.state(), ended.lost_workers),
        (job::State::Cancelled, 1)
    );
    assert_eq!(service.lease(&worker).await, None);
}
