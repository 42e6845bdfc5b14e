//! Hints between coordinators: whoever waits at one learns at once what happens at the other, and later if hints are lost.

use crate::support::{Service, claim, job_name};
use futures::StreamExt;
use std::time::Duration;
use tonic::Streaming;
use yoto_proto::v1::{JobKind, Progress, WatchJobRequest, WatchJobResponse};
use yoto_proto::worker::v1::{HeartbeatRequest, Lease, WaitForJobRequest};
use yoto_server::ServerConfig;

/// Longer than any test.
const NEVER: Duration = Duration::from_secs(3600);
/// Between two reports of a worker.
const BEAT: Duration = Duration::from_millis(100);

/// Finds changes by hints alone.
fn only_hints(config: &mut ServerConfig) {
    (config.watch_poll, config.hinted_poll) = (NEVER, NEVER);
}

/// Whether a worker that waits at `service` is told of a job, while `happens` goes on.
async fn is_told(service: &Service, happens: impl Future<Output = ()>) -> bool {
    let request = WaitForJobRequest {
        kinds: vec![JobKind::Train.into()],
        seconds: 10.0,
    };
    let mut workers = service.workers();
    tokio::select! {
        answer = workers.wait_for_job(request) => answer.expect("answers").into_inner().queued,
        () = happens => unreachable!("it goes on"),
    }
}

/// Orders trainings.
async fn train(service: &Service) {
    let subject = service.ready_subject("Ada").await;
    let model = service.model_of(&subject).await;
    loop {
        service.train(&model).await;
        tokio::time::sleep(BEAT).await;
    }
}

#[tokio::test]
async fn a_worker_that_waits_is_told_of_a_new_job() {
    let service = Service::start().await;
    assert!(is_told(&service, train(&service)).await);
}

#[tokio::test]
async fn a_worker_that_waits_at_another_coordinator_is_told_of_a_new_job() {
    let first = Service::start().await;
    let Some(second) = first.beside().await else {
        return;
    };
    assert!(is_told(&second, train(&first)).await);
}

#[tokio::test]
async fn a_worker_that_waits_for_nothing_is_answered_in_time() {
    let service = Service::start().await;
    let request = WaitForJobRequest {
        kinds: vec![JobKind::Train.into()],
        seconds: 0.01,
    };
    let answer = service.workers().wait_for_job(request).await;
    assert!(!answer.expect("answers").into_inner().queued);
}

/// A running training.
async fn running(service: &Service) -> Lease {
    let subject = service.ready_subject("Ada").await;
    let model = service.model_of(&subject).await;
    service.train(&model).await;
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await;
    lease.expect("the training waits")
}

/// A watch at `service` of a running job, of which the present state was read.
async fn watch(service: &Service, lease: &Lease) -> Streaming<WatchJobResponse> {
    let request = WatchJobRequest {
        name: job_name(lease),
        after_sequence: 0,
    };
    let watched = service.jobs().watch_job(request).await;
    let mut watched = watched.expect("is watched").into_inner();
    watched.next().await.expect("a state").expect("no error");
    watched
}

/// The progress in the next state of a job whose worker reports at `reports` meanwhile.
async fn next(
    watched: &mut Streaming<WatchJobResponse>,
    reports: &Service,
    lease: &Lease,
) -> Progress {
    let beats = async {
        for step in 1.. {
            let progress = Progress {
                step,
                ..Progress::default()
            };
            let request = HeartbeatRequest {
                claim: Some(claim(lease)),
                progress: Some(progress),
            };
            let heard = reports.workers().heartbeat(request).await;
            heard.expect("is recorded");
            tokio::time::sleep(BEAT).await;
        }
    };
    let state = async {
        let next = tokio::time::timeout(Duration::from_secs(20), watched.next()).await;
        let next = next.expect("in time").expect("a state");
        let job = next.expect("no error").job;
        let progress = job.and_then(|it| it.progress);
        progress.expect("was reported")
    };
    tokio::select! {
        state = state => state,
        () = beats => unreachable!("it goes on"),
    }
}

#[tokio::test]
async fn a_watcher_at_another_coordinator_sees_a_report() {
    let first = Service::start_with(only_hints).await;
    let Some(second) = first.beside_with(only_hints).await else {
        return;
    };
    let lease = running(&first).await;
    let mut watched = watch(&second, &lease).await;
    assert!(next(&mut watched, &first, &lease).await.step > 0);
}

#[tokio::test]
async fn a_watcher_sees_a_report_whose_hint_is_lost_at_the_next_poll() {
    let first = Service::start_with(|config| config.hints = false).await;
    let short = |config: &mut ServerConfig| (config.watch_poll, config.hinted_poll) = (BEAT, BEAT);
    let Some(second) = first.beside_with(short).await else {
        return;
    };
    let lease = running(&first).await;
    let mut watched = watch(&second, &lease).await;
    assert!(next(&mut watched, &first, &lease).await.step > 0);
}
