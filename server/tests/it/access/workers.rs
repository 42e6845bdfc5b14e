//! Workers' keys: they open the workers' calls alone, and a worker is its key's own.

use crate::support::{Made, Service, assert_refused};
use tonic::{Code, Status};
use yoto_proto::orders::LEVEL;
use yoto_proto::v1::{JobKind, Scope, WorkerDevice};
use yoto_proto::worker::v1::worker_service_client::WorkerServiceClient;
use yoto_proto::worker::v1::{
    Claim, HeartbeatRequest, Lease, LeaseJobRequest, RegisterWorkerRequest,
};

async fn register(service: &Service, key: &Made) -> String {
    let request = RegisterWorkerRequest {
        display_name: "w".into(),
        device: Some(WorkerDevice::default()),
        kinds: vec![JobKind::Train.into()],
        order_level: LEVEL,
        ..RegisterWorkerRequest::default()
    };
    let mut workers = WorkerServiceClient::new(service.with_key(key));
    let registered = workers.register_worker(request).await;
    registered.expect("registers").into_inner().worker
}

async fn lease(service: &Service, key: &Made, worker: &str) -> Result<Option<Lease>, Status> {
    let request = LeaseJobRequest {
        worker: worker.into(),
        ..LeaseJobRequest::default()
    };
    let mut workers = WorkerServiceClient::new(service.with_key(key));
    Ok(workers.lease_job(request).await?.into_inner().lease)
}

async fn beat(service: &Service, key: &Made, claim: &Claim) -> Result<(), Status> {
    let request = HeartbeatRequest {
        claim: Some(claim.clone()),
        progress: None,
    };
    let mut workers = WorkerServiceClient::new(service.with_key(key));
    workers.heartbeat(request).await.map(drop)
}

#[tokio::test]
async fn a_worker_is_its_keys_own() {
    let service = Service::start().await;
    let subject = service.ready_subject("Ada").await;
    service.train(&service.model_of(&subject).await).await;
    let before = service.worker(&["train"]).await;
    let own = service.key("default", &[Scope::Work]).await;
    let other = service.key("default", &[Scope::Work]).await;
    let worker = register(&service, &own).await;
    // Another key knows neither it nor its lease, and no key knows a worker of before.
    for (key, worker) in [(&other, &worker), (&own, &before)] {
        let refused = lease(&service, key, worker).await;
        assert_refused(refused, Code::NotFound, "NOT_FOUND");
    }
    let leased = lease(&service, &own, &worker).await.expect("may");
    let leased = leased.expect("the training waits");
    let claim = crate::support::claim(&leased);
    let claim = Claim { worker, ..claim };
    beat(&service, &own, &claim).await.expect("may");
    assert_refused(
        beat(&service, &other, &claim).await,
        Code::NotFound,
        "NOT_FOUND",
    );
    service.revoke(&own.name).await;
    let refused = beat(&service, &own, &claim).await;
    assert_refused(refused, Code::Unauthenticated, "KEY_REVOKED");
}
