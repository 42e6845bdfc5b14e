//! Watches of jobs: in order, resumable, and ended by the terminal state.

use crate::support::{Service, assert_invalid, assert_refused, claim, job_error};
use futures::{StreamExt, TryStreamExt};
use prost::Message;
use std::time::Duration;
use tonic::{Code, Streaming};
use yoto_proto::v1::{
    CancelJobRequest, Job, Progress, TrainResult, WatchJobRequest, WatchJobResponse, job,
    job_result,
};
use yoto_proto::worker::v1::HeartbeatRequest;
use yoto_proto::worker::v1::end_job_request::Outcome;

async fn watch(service: &Service, name: &str, after_sequence: u64) -> Streaming<WatchJobResponse> {
    let request = WatchJobRequest {
        name: name.into(),
        after_sequence,
    };
    service
        .jobs()
        .watch_job(request)
        .await
        .expect("is watched")
        .into_inner()
}

async fn next(stream: &mut Streaming<WatchJobResponse>) -> Job {
    let next = tokio::time::timeout(Duration::from_secs(20), stream.next()).await;
    let answer = next
        .expect("in time")
        .expect("not ended")
        .expect("no error");
    answer.job.expect("has a job")
}

/// As watchers see it.
fn without_order(job: Job) -> Job {
    Job { spec: None, ..job }
}

async fn rest(stream: Streaming<WatchJobResponse>) -> Vec<Job> {
    let all = stream
        .map_ok(|answer| answer.job.expect("has a job"))
        .try_collect();
    tokio::time::timeout(Duration::from_secs(20), all)
        .await
        .expect("ends")
        .expect("no error")
}

#[tokio::test]
async fn a_watcher_sees_each_change_in_order_and_the_end() {
    let service = Service::start().await;
    let subject = service.ready_subject("Ada").await;
    let job = service.train(&service.model_of(&subject).await).await;
    let mut stream = watch(&service, &job.name, 0).await;
    let seen = next(&mut stream).await;
    assert!(job.spec.is_some());
    assert_eq!(seen, without_order(job.clone()), "the current state first");
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("the training waits");
    let running = next(&mut stream).await;
    assert_eq!(
        (running.state(), running.sequence),
        (job::State::Running, 2)
    );
    for step in 1..=3 {
        let progress = Some(Progress {
            step,
            ..<_>::default()
        });
        let request = HeartbeatRequest {
            claim: Some(claim(&lease)),
            progress,
        };
        // The same news twice is one change.
        service
            .workers()
            .heartbeat(request.clone())
            .await
            .expect("holds the lease");
        service
            .workers()
            .heartbeat(request)
            .await
            .expect("holds the lease");
        let seen = next(&mut stream).await;
        assert_eq!(
            (seen.sequence, seen.progress.expect("has it").step),
            (2 + step, step)
        );
    }
    let error = Outcome::Failed(job_error("DIVERGED", ""));
    service.end(&lease, error).await.expect("is recorded");
    let end = rest(stream).await;
    assert_eq!(end.len(), 1);
    assert_eq!((end[0].state(), end[0].sequence), (job::State::Failed, 6));

    assert_eq!(
        rest(watch(&service, &job.name, 3).await).await,
        end,
        "what is newer"
    );
    assert_eq!(
        rest(watch(&service, &job.name, 6).await).await,
        [],
        "nothing is newer"
    );
    assert_eq!(
        rest(watch(&service, &job.name, 99).await).await,
        end,
        "a number it never had"
    );
    let request = WatchJobRequest {
        name: "jobs/none".into(),
        after_sequence: 0,
    };
    assert_refused(
        service.jobs().watch_job(request).await,
        Code::NotFound,
        "NOT_FOUND",
    );
}

#[tokio::test]
async fn a_watcher_that_knows_the_job_waits_for_the_next_change() {
    let service = Service::start().await;
    let subject = service.ready_subject("Ada").await;
    let job = service.train(&service.model_of(&subject).await).await;
    let stream = watch(&service, &job.name, job.sequence).await;
    let request = CancelJobRequest {
        request_id: String::new(),
        name: job.name.clone(),
    };
    let cancelled = service
        .jobs()
        .cancel_job(request)
        .await
        .expect("is heard")
        .into_inner();
    assert_eq!(rest(stream).await, [without_order(cancelled)]);
}

#[tokio::test]
async fn reports_of_workers_have_a_maximum_length() {
    let service = Service::start().await;
    let subject = service.ready_subject("Ada").await;
    let job = service.train(&service.model_of(&subject).await).await;
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("the training waits");
    let lines = || vec!["x".repeat(12); 500_000];
    let request = HeartbeatRequest {
        claim: Some(claim(&lease)),
        progress: Some(Progress {
            active_parts: lines(),
            ..<_>::default()
        }),
    };
    let told = service.workers().heartbeat(request).await;
    told.expect("holds the lease");
    let told = service.get_job(&job.name).await.progress;
    assert!(told.expect("is stored").encoded_len() < 64 << 10);
    let checkpoint = service.publish(&lease, 1).await.expect("publishes");
    let result = |notes, checkpoint| {
        job_result::Kind::Train(TrainResult {
            notes,
            checkpoint,
            ..<_>::default()
        })
    };
    let long = "x".repeat(2 << 20);
    let refused = service.complete(&lease, result(Vec::new(), long)).await;
    assert_invalid(refused, "result");
    let ended = service.complete(&lease, result(lines(), checkpoint.name));
    ended.await.expect("is cut");
    let told = service.get_job(&job.name).await.result;
    assert!(told.expect("is stored").encoded_len() < 64 << 10);
}

#[tokio::test]
async fn a_shutdown_ends_the_watchers() {
    let service = Service::start().await;
    let subject = service.ready_subject("Ada").await;
    let job = service.train(&service.model_of(&subject).await).await;
    let mut stream = watch(&service, &job.name, 0).await;
    next(&mut stream).await;
    service.stop().await;
    let next = tokio::time::timeout(Duration::from_secs(20), stream.next()).await;
    let status = next
        .expect("in time")
        .expect("an item")
        .expect_err("the reason");
    assert_eq!(status.code(), Code::Unavailable, "{status}");
}
