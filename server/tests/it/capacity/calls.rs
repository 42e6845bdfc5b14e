//! Open calls.

use super::{door, lists, with_key};
use crate::support::{Service, ask, assert_refused};
use tonic::{Code, Status, Streaming};
use yoto_proto::key::Connection;
use yoto_proto::orders::LEVEL;
use yoto_proto::v1::job_service_client::JobServiceClient;
use yoto_proto::v1::key_service_client::KeyServiceClient;
use yoto_proto::v1::{
    JobKind, ListKeysRequest, Scope, WatchJobsRequest, WatchJobsResponse, WorkerDevice,
};
use yoto_proto::worker::v1::RegisterWorkerRequest;
use yoto_proto::worker::v1::worker_service_client::WorkerServiceClient;

async fn watch(connection: &Connection) -> Result<Streaming<WatchJobsResponse>, Status> {
    let mut jobs = JobServiceClient::new(connection.clone());
    let watched = jobs.watch_jobs(WatchJobsRequest::default()).await;
    watched.map(tonic::Response::into_inner)
}

/// Watches until one is refused, on connections of their own.
async fn watches(
    address: std::net::SocketAddr,
    key: &crate::support::Made,
) -> Vec<Streaming<WatchJobsResponse>> {
    let mut open = Vec::new();
    loop {
        match watch(&with_key(address, key).await).await {
            Ok(stream) => open.push(stream),
            Err(status) => {
                assert_refused::<()>(Err(status), Code::Unavailable, "BUSY");
                return open;
            }
        }
    }
}

#[tokio::test]
async fn watches_of_one_key_hold_up_no_other_key_tenant_worker_operator_or_probe() {
    let service = Service::start_with(|config| {
        config.traffic.user_calls = 30;
        config.traffic.worker_calls = 4;
        config.traffic.operator_calls = 4;
    })
    .await;
    let greedy = service.key("greedy", &[Scope::Read]).await;
    let colleague = service.key("greedy", &[Scope::Read]).await;
    let other = service.key("other", &[Scope::Read]).await;
    let worker = service.key("other", &[Scope::Work]).await;
    let operator = service.key("default", &[Scope::Operate]).await;
    let address = door(&service).await;

    let mut open = watches(address, &greedy).await;
    assert_eq!(open.len(), 10, "a third");
    lists(&with_key(address, &colleague).await)
        .await
        .expect("another key of the tenant");
    // The tenant's keys together leave half to others.
    open.extend(watches(address, &colleague).await);
    assert!(open.len() <= 15, "{}", open.len());
    lists(&with_key(address, &other).await)
        .await
        .expect("another tenant");
    let others = watches(address, &other).await;
    assert!(others.len() >= 4, "{}", others.len());

    let register = RegisterWorkerRequest {
        display_name: "w".into(),
        device: Some(WorkerDevice::default()),
        kinds: vec![JobKind::Train.into()],
        order_level: LEVEL,
        ..RegisterWorkerRequest::default()
    };
    let mut workers = WorkerServiceClient::new(with_key(address, &worker).await);
    workers.register_worker(register).await.expect("a worker");
    let mut keys = KeyServiceClient::new(with_key(address, &operator).await);
    keys.list_keys(ListKeysRequest::default())
        .await
        .expect("an operator");
    for probe in ["/healthz", "/readyz"] {
        assert_eq!(ask(address, "GET", probe).await.0, 200, "{probe}");
    }

    // What ends is free again.
    drop(open);
    crate::support::eventually("a free place", || async {
        watch(&with_key(address, &greedy).await).await.ok()
    })
    .await;
}

#[tokio::test]
async fn probes_are_answered_when_no_call_is_left() {
    let service = Service::start_with(|config| config.traffic.calls = 0).await;
    let address = door(&service).await;
    for probe in ["/healthz", "/readyz"] {
        assert_eq!(ask(address, "GET", probe).await.0, 200, "{probe}");
    }
    assert_eq!(ask(address, "GET", "/people").await.0, 503);
}

#[tokio::test]
async fn calls_without_a_key_leave_room_for_those_with_one() {
    let service = Service::start_with(|config| config.traffic.open_calls = 4).await;
    let key = service.key("default", &[Scope::Read]).await;
    let address = door(&service).await;
    let mut open = Vec::new();
    loop {
        let channel = super::channel(address).await;
        let mut health = tonic_health::pb::health_client::HealthClient::new(channel);
        let request = tonic_health::pb::HealthCheckRequest::default();
        match health.watch(request).await {
            Ok(stream) => open.push(stream),
            Err(status) => break assert_eq!(status.code(), Code::Unavailable),
        }
    }
    assert_eq!(open.len(), 2, "a half");
    lists(&with_key(address, &key).await)
        .await
        .expect("a caller with a key");
    assert_eq!(ask(address, "GET", "/readyz").await.0, 200);
}
