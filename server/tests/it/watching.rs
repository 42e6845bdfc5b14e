//! Watches of jobs: in order, resumable, and ended by the terminal state.

use crate::support::{Service, assert_refused, claim, job_error};
use futures::{StreamExt, TryStreamExt};
use std::time::Duration;
use tonic::{Code, Streaming};
use yoto_proto::v1::end_job_request::Outcome;
use yoto_proto::v1::{
    CancelJobRequest, HeartbeatRequest, Job, Progress, WatchJobRequest, WatchJobResponse, job,
};

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
    assert_eq!(next(&mut stream).await, job, "the current state first");
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
    assert_eq!(rest(stream).await, [cancelled]);
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
