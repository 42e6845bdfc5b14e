//! Watches of all jobs: the open ones, then each change, and after a gap what the caller does not know.

use crate::support::{Service, assert_invalid, assert_refused, job_error};
use futures::StreamExt;
use std::time::Duration;
use tonic::{Code, Streaming};
use yoto_proto::v1::{
    CancelJobRequest, DeleteJobRequest, Job, JobKind, KnownJob, WatchJobsRequest,
    WatchJobsResponse, job,
};
use yoto_proto::worker::v1::end_job_request::Outcome;

async fn watch(service: &Service, request: WatchJobsRequest) -> Streaming<WatchJobsResponse> {
    let answer = service.jobs().watch_jobs(request).await;
    answer.expect("is watched").into_inner()
}

async fn next(stream: &mut Streaming<WatchJobsResponse>) -> WatchJobsResponse {
    let next = tokio::time::timeout(Duration::from_secs(20), stream.next()).await;
    next.expect("in time")
        .expect("not ended")
        .expect("no error")
}

/// The only job of the next response.
async fn next_job(stream: &mut Streaming<WatchJobsResponse>) -> (String, job::State) {
    let response = next(stream).await;
    let [job] = &response.jobs[..] else {
        panic!("{response:?}");
    };
    assert_eq!(job.spec, None, "watchers know the order");
    (job.name.clone(), job.state())
}

async fn cancel(service: &Service, name: &str) -> Job {
    let request = CancelJobRequest {
        name: name.into(),
        request_id: String::new(),
    };
    let cancelled = service.jobs().cancel_job(request).await;
    cancelled.expect("is heard").into_inner()
}

#[tokio::test]
async fn a_watcher_sees_the_open_jobs_then_new_ones_and_their_ends() {
    let service = Service::start().await;
    let subject = service.ready_subject("Ada").await;
    let model = service.model_of(&subject).await;
    let mut all = watch(&service, WatchJobsRequest::default()).await;
    assert_eq!(next(&mut all).await, WatchJobsResponse::default());
    let first = service.train(&model).await;
    let queued = job::State::Queued;
    assert_eq!(next_job(&mut all).await, (first.name.clone(), queued));
    let mut second = watch(&service, WatchJobsRequest::default()).await;
    assert_eq!(next_job(&mut second).await, (first.name.clone(), queued));
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("the training waits");
    for stream in [&mut all, &mut second] {
        let change = next_job(stream).await;
        assert_eq!(change, (first.name.clone(), job::State::Running));
    }
    let error = Outcome::Failed(job_error("DIVERGED", ""));
    service.end(&lease, error).await.expect("is recorded");
    for stream in [&mut all, &mut second] {
        let change = next_job(stream).await;
        assert_eq!(change, (first.name.clone(), job::State::Failed));
    }
}

#[tokio::test]
async fn a_job_that_begins_and_ends_between_two_polls_is_seen() {
    let slow = |config: &mut yoto_server::ServerConfig| config.watch_poll = Duration::from_secs(1);
    let service = Service::start_with(slow).await;
    let subject = service.ready_subject("Ada").await;
    let model = service.model_of(&subject).await;
    let mut all = watch(&service, WatchJobsRequest::default()).await;
    next(&mut all).await;
    let queued = service.train(&model).await;
    cancel(&service, &queued.name).await;
    let change = loop {
        let change = next_job(&mut all).await;
        if change.1 != job::State::Queued {
            break change;
        }
    };
    assert_eq!(change, (queued.name, job::State::Cancelled));
}

#[tokio::test]
async fn an_end_is_sent_once() {
    let service = Service::start().await;
    let subject = service.ready_subject("Ada").await;
    let model = service.model_of(&subject).await;
    let mut all = watch(&service, WatchJobsRequest::default()).await;
    assert_eq!(next(&mut all).await, WatchJobsResponse::default());
    // The first reading of the queue found the ended ingest; later ones find it and the ends of these again.
    for _ in 0..3 {
        let queued = service.train(&model).await;
        let name = queued.name.clone();
        assert_eq!(next_job(&mut all).await, (name, job::State::Queued));
        cancel(&service, &queued.name).await;
        let change = next_job(&mut all).await;
        assert_eq!(change, (queued.name, job::State::Cancelled));
    }
}

#[tokio::test]
async fn only_jobs_of_the_filter_are_sent() {
    let service = Service::start().await;
    let subject = service.ready_subject("Ada").await;
    let model = service.model_of(&subject).await;
    let other = service.joined(service.model("other").await, &subject).await;
    let of_other = WatchJobsRequest {
        model: other.name.clone(),
        ..<_>::default()
    };
    let mut watched = watch(&service, of_other).await;
    let ingests = WatchJobsRequest {
        kinds: vec![JobKind::Ingest.into()],
        ..<_>::default()
    };
    let mut ingests = watch(&service, ingests).await;
    next(&mut watched).await;
    next(&mut ingests).await;
    service.train(&model).await;
    let wanted = service.train(&other).await;
    let change = next_job(&mut watched).await;
    assert_eq!(change, (wanted.name, job::State::Queued));
    let ingest = service.upload_good(&subject.name).await.ingest_job;
    let change = next_job(&mut ingests).await;
    assert_eq!(change, (ingest, job::State::Queued), "no training before");
}

#[tokio::test]
async fn after_a_gap_only_what_has_changed_is_sent() {
    let service = Service::start().await;
    let subject = service.ready_subject("Ada").await;
    let model = service.model_of(&subject).await;
    let (stays, ends, goes) = (
        service.train(&model).await,
        service.train(&model).await,
        service.train(&model).await,
    );
    let known = [&stays, &ends, &goes].map(|job| KnownJob {
        name: job.name.clone(),
        sequence: job.sequence,
    });
    cancel(&service, &ends.name).await;
    cancel(&service, &goes.name).await;
    let request = DeleteJobRequest {
        name: goes.name.clone(),
        ..<_>::default()
    };
    service.jobs().delete_job(request).await.expect("is gone");
    let request = WatchJobsRequest {
        known: known.to_vec(),
        ..<_>::default()
    };
    let mut again = watch(&service, request.clone()).await;
    let response = next(&mut again).await;
    assert_eq!(response.deleted, [goes.name]);
    let names: Vec<_> = response.jobs.iter().map(|job| &job.name).collect();
    assert_eq!(names, [&ends.name]);
    cancel(&service, &stays.name).await;
    let change = next_job(&mut again).await;
    assert_eq!(change, (stays.name, job::State::Cancelled));

    let mut many = request;
    many.known = vec![many.known[0].clone(); 1001];
    assert_invalid(service.jobs().watch_jobs(many).await, "known");
}

#[tokio::test]
async fn a_shutdown_ends_the_watchers_of_all_jobs() {
    let service = Service::start().await;
    let mut all = watch(&service, WatchJobsRequest::default()).await;
    next(&mut all).await;
    service.stop().await;
    let end = tokio::time::timeout(Duration::from_secs(20), all.next()).await;
    let end = end.expect("in time").expect("an item");
    assert_refused(end, Code::Unavailable, "SHUTTING_DOWN");
}
