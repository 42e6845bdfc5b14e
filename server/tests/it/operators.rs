//! Drains of the service and cordons of workers.

use crate::support::{Service, assert_invalid, assert_refused};
use tonic::Code;
use yoto_proto::v1::status_service_client::StatusServiceClient;
use yoto_proto::v1::{
    CordonWorkerRequest, CreateJobRequest, DrainRequest, EndDrainRequest, GetStatusRequest,
    JobSpec, TrainSpec, UncordonWorkerRequest, job, job_spec,
};

fn operator(service: &Service) -> StatusServiceClient<tonic::transport::Channel> {
    StatusServiceClient::new(service.channel.clone())
}

fn order(model: &str) -> CreateJobRequest {
    let spec = TrainSpec {
        model: model.to_owned(),
        steps: 5,
        ..TrainSpec::default()
    };
    CreateJobRequest {
        spec: Some(JobSpec {
            kind: Some(job_spec::Kind::Train(spec)),
        }),
        request_id: "one".to_owned(),
        ..CreateJobRequest::default()
    }
}

#[tokio::test]
async fn a_drained_service_takes_no_jobs_gives_no_leases_and_remembers_it() {
    let service = Service::start().await;
    let subject = service.ready_subject("Ada").await;
    let model = service.model_of(&subject).await;
    let running = service.train(&model).await;
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("the training waits");
    let queued = service.train(&service.model_of(&subject).await).await;
    let reason = "the disk is exchanged".to_owned();
    let request = DrainRequest { reason };
    let drained = operator(&service).drain(request).await;
    drained.expect("is drained");

    let refused = service.jobs().create_job(order(&model.name)).await;
    let status = refused
        .as_ref()
        .expect_err("is refused")
        .message()
        .to_owned();
    assert!(status.contains("the disk is exchanged"), "{status}");
    assert_refused(refused, Code::FailedPrecondition, "DRAINING");
    let second = service.worker(&["train"]).await;
    assert!(service.lease(&second).await.is_none());
    // What runs goes on.
    service.publish(&lease, 3).await.expect("holds the lease");

    let service = Service::start_in(service.stop().await, |_| {}).await;
    assert!(service.lease(&second).await.is_none());
    let status = operator(&service).get_status(GetStatusRequest {}).await;
    let draining = status.expect("answers").into_inner().draining;
    let draining = draining.expect("is drained still");
    assert_eq!(draining.reason, "the disk is exchanged");
    let ended = operator(&service).end_drain(EndDrainRequest {}).await;
    ended.expect("is ended");
    let lease = service.lease(&second).await.expect("gets it now");
    assert_eq!(lease.job.expect("a job").name, queued.name);
    let job = service.get_job(&running.name).await;
    assert_eq!(job.state(), job::State::Running);
    // The id was not used by the refused call.
    let created = service.jobs().create_job(order(&model.name)).await;
    created.expect("is queued");
}

#[tokio::test]
async fn a_cordoned_worker_gets_no_lease_even_after_it_registers_again() {
    let service = Service::start().await;
    let subject = service.ready_subject("Ada").await;
    service.train(&service.model_of(&subject).await).await;
    let worker = service.worker(&["train"]).await;
    let name = "test worker".to_owned();
    let request = CordonWorkerRequest {
        display_name: name.clone(),
        reason: "a fan is broken".to_owned(),
    };
    let cordoned = operator(&service).cordon_worker(request.clone()).await;
    cordoned.expect("is cordoned");
    assert!(service.lease(&worker).await.is_none());
    let again = service.worker(&["train"]).await;
    assert!(service.lease(&again).await.is_none());
    let status = operator(&service).get_status(GetStatusRequest {}).await;
    let cordons = status.expect("answers").into_inner().cordons;
    assert_eq!((cordons.len(), &*cordons[0].reason), (1, "a fan is broken"));
    let request = CordonWorkerRequest {
        display_name: String::new(),
        ..request
    };
    let nameless = operator(&service).cordon_worker(request).await;
    assert_invalid(nameless, "display_name");
    let other = service.worker_called("another", &["train"]).await;
    service.lease(&other).await.expect("has another name");
    service.train(&service.model_of(&subject).await).await;
    let request = UncordonWorkerRequest { display_name: name };
    let uncordoned = operator(&service).uncordon_worker(request).await;
    uncordoned.expect("is uncordoned");
    service.lease(&again).await.expect("gets one now");
}
