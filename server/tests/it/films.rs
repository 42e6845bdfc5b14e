//! Films without poses: they are taken where a worker has a pose model, and no other worker gets them.

use crate::support::{Service, assert_invalid, file};
use yoto_proto::v1::GetLimitsRequest;
use yoto_proto::v1::status_service_client::StatusServiceClient;

/// Whether the service says that it takes films.
async fn takes_films(service: &Service) -> bool {
    let limits = StatusServiceClient::new(service.channel.clone())
        .get_limits(GetLimitsRequest {})
        .await;
    let limits = limits.expect("answers").into_inner();
    limits.upload.expect("limits of uploads").films
}

#[tokio::test]
async fn a_film_needs_a_worker_with_a_pose_model() {
    let service = Service::start().await;
    let subject = service.subject("Ada").await;
    let film = || vec![file("walk.MOV", b"film")];
    let plain = service.worker(&["ingest"]).await;
    assert!(service.lease(&plain).await.is_none(), "nothing waits");
    assert!(!takes_films(&service).await);
    assert_invalid(service.upload(&subject.name, film()).await, "files");

    let seeing = service.worker_for_films().await;
    assert!(takes_films(&service).await);
    let two = [film(), vec![file("other.mp4", b"film")]].concat();
    assert_invalid(service.upload(&subject.name, two).await, "files");

    let capture = service
        .upload(&subject.name, film())
        .await
        .expect("is taken");
    assert!(service.lease(&plain).await.is_none(), "it finds no poses");
    let lease = service
        .lease(&seeing)
        .await
        .expect("the ingest of the film");
    let job = lease.job.expect("a job");
    assert_eq!((job.name, job.capture), (capture.ingest_job, capture.name));

    let bob = service.subject("Bob").await;
    let capture = service.upload_good(&bob.name).await;
    let lease = service.lease(&plain).await.expect("a capture with poses");
    assert_eq!(lease.job.expect("a job").name, capture.ingest_job);
}
