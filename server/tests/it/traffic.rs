//! Limits of traffic: a call beyond a limit is refused, and a later one succeeds.

use crate::support::{Service, assert_refused, eventually};
use tonic::Code;
use tonic::transport::Channel;
use yoto_proto::v1::subject_service_client::SubjectServiceClient;
use yoto_proto::v1::{ListJobsRequest, ListSubjectsRequest, WatchJobRequest};

async fn lists(channel: &Channel) -> Result<(), tonic::Status> {
    let listed = SubjectServiceClient::new(channel.clone())
        .list_subjects(ListSubjectsRequest::default())
        .await;
    listed.map(drop)
}

#[tokio::test]
async fn calls_beyond_the_limit_are_refused_until_another_ends() {
    let service = Service::start_with(|config| config.traffic.calls = 1).await;
    let subject = service.ready_subject("Ada").await;
    let job = service.train(&service.model_of(&subject).await).await;
    let request = WatchJobRequest {
        name: job.name,
        after_sequence: job.sequence,
    };
    let watched = service.jobs().watch_job(request).await.expect("is watched");
    let other = service.connector.channel();
    assert_refused(lists(&other).await, Code::Unavailable, "BUSY");
    // A stream of answers counts until its end.
    drop(watched);
    eventually("a free place", || async { lists(&other).await.ok() }).await;
}

#[tokio::test]
async fn connections_beyond_the_limit_are_refused_until_another_ends() {
    let service = Service::start_with(|config| config.traffic.connections = 1).await;
    lists(&service.channel).await.expect("is the first");
    let other = service.connector.channel();
    let refused = lists(&other).await.expect_err("is the second");
    // The client sees a lost connection.
    assert!(
        matches!(
            refused.code(),
            Code::Unavailable | Code::Unknown | Code::Cancelled
        ),
        "{refused:?}"
    );
    let Service {
        channel,
        coordinator: _coordinator,
        ..
    } = service;
    drop(channel);
    eventually("a free place", || async { lists(&other).await.ok() }).await;
}

#[tokio::test]
async fn a_message_of_too_many_entries_is_refused_before_it_is_decoded() {
    let service = Service::start_with(|config| config.traffic.decoded_bytes = 1000).await;
    let states = |count| ListJobsRequest {
        states: vec![1; count],
        ..ListJobsRequest::default()
    };
    let few = service.jobs().list_jobs(states(50)).await;
    few.expect("is answered");
    let many = service.jobs().list_jobs(states(500)).await;
    assert_eq!(many.expect_err("is refused").code(), Code::OutOfRange);
}

#[tokio::test]
async fn a_message_beyond_the_limit_is_refused() {
    let service = Service::start_with(|config| config.traffic.message_bytes = 1000).await;
    let request = ListSubjectsRequest {
        page_token: "x".repeat(1001),
        ..ListSubjectsRequest::default()
    };
    let mut subjects = SubjectServiceClient::new(service.channel.clone());
    let refused = subjects.list_subjects(request).await;
    assert_eq!(refused.expect_err("is too long").code(), Code::OutOfRange);
}
