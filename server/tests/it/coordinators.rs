//! Two coordinators of one database of PostgreSQL and one store.

use crate::support::{Service, assert_refused, chunk, eventually, file, job_name};
use futures::stream::{self, StreamExt};
use tonic::Code;
use url::Url;
use yoto_proto::v1::{GetUploadRequest, Subject, WriteUploadRequest, capture, job, subject};
use yoto_server::{BindingError, Coordinator, ServerConfig, ServerError};
use yoto_test_s3::{BUCKET, Server};

/// An upload of Ada's to `service`, of which the first half of the film has come.
async fn half_of_an_upload(service: &Service) -> (Subject, String) {
    let subject = service.subject("Ada").await;
    let files = [file("poses.json", b"{}"), file("video.mp4", b"0123456789")];
    let name = service.open_upload(&subject.name, &files).await;
    let name = name.expect("is opened").name;
    let half = vec![chunk(&name, "video.mp4", 0, b"01234")];
    service.write(half).await.expect("is committed");
    (subject, name)
}

/// The rest of that upload.
fn other_half(name: &str) -> Vec<WriteUploadRequest> {
    vec![
        chunk(name, "video.mp4", 5, b"56789"),
        chunk(name, "poses.json", 0, b"{}"),
    ]
}

/// Whether the objects are refused as those of another database.
fn names_other_objects(error: &ServerError) -> bool {
    match error {
        ServerError::Binding(error) => matches!(**error, BindingError::OtherObjects { .. }),
        _ => false,
    }
}

#[tokio::test]
async fn an_upload_goes_on_at_another_coordinator() {
    let first = Service::start_with(|config| config.upload.part_bytes = 4).await;
    let Some(second) = first.beside().await else {
        return;
    };
    let subject = first.subject("Ada").await;
    let files = [file("poses.json", b"{}"), file("video.mp4", b"0123456789")];
    let name = second.open_upload(&subject.name, &files).await;
    let name = name.expect("is opened").name;
    let begun = vec![
        chunk(&name, "video.mp4", 0, b"0123"),
        chunk(&name, "video.mp4", 4, b"xx"),
    ];
    let messages = stream::iter(begun).chain(stream::pending());
    let mut uploads = first.uploads();
    // Its connection is lost, which nobody has noticed.
    let lost = tokio::spawn(async move { uploads.write_upload(messages).await });
    let committed = async || {
        let request = GetUploadRequest {
            name: name.clone(),
            stop_writer: false,
        };
        let upload = second.uploads().get_upload(request).await;
        upload.expect("is there").into_inner().committed_bytes
    };
    eventually("the first part", async || {
        (committed().await == 4).then_some(())
    })
    .await;
    let rest = vec![
        chunk(&name, "video.mp4", 4, b"456789"),
        chunk(&name, "poses.json", 0, b"{}"),
    ];
    second.write(rest).await.expect("is the newest writer");
    // Now its last bytes are to be committed.
    lost.abort();
    let capture = second.finish(&name).await.expect("is complete");

    // A worker registers with one and leases from the other.
    let worker = first.worker(&["ingest"]).await;
    let lease = second.lease(&worker).await.expect("the job waits");
    assert_eq!(first.ingested(&lease, "video.mp4"), b"0123456789");
    first.complete_ingest(&lease).await;
    let state = second.get_capture(&capture.name).await.state();
    assert_eq!(state, capture::State::Ready);
}

#[tokio::test]
async fn half_of_an_upload_comes_by_each_coordinator_and_one_is_killed() {
    let first = Service::start().await;
    let Some(second) = first.beside().await else {
        return;
    };
    let (subject, name) = half_of_an_upload(&first).await;
    let again = vec![chunk(&name, "video.mp4", 0, b"01234")];
    let answer = second.write(again).await;
    assert_refused(answer, Code::FailedPrecondition, "UPLOAD_OFFSET");
    let folder = first.kill();
    second.write(other_half(&name)).await.expect("goes on");
    second.finish(&name).await.expect("is complete");
    let lease = second.ingest_lease().await;
    assert_eq!(second.ingested(&lease, "video.mp4"), b"0123456789");
    second.complete_ingest(&lease).await;
    let ada = second.get_subject(&subject.name).await;
    assert_eq!(ada.state(), subject::State::Ready);
    drop(folder);
}

#[tokio::test]
async fn a_coordinator_that_starts_takes_back_the_jobs_of_its_own_process_only() {
    let first = Service::start().await;
    let Some(second) = first.beside().await else {
        return;
    };
    let ada = first.ready_subject("Ada").await;
    let model = first.model_of(&ada).await;
    first.train(&model).await;
    let embedded = second.embedded_worker().await;
    let lease = second.lease(&embedded).await.expect("the training waits");
    let third = first.beside().await.expect("shares");
    let state = async |service: &Service| {
        let job = service.get_job(&job_name(&lease)).await;
        (job.state(), job.lost_workers)
    };
    assert_eq!(state(&third).await, (job::State::Running, 0));
    let objects = first.coordinator.objects_url().clone();
    let url = first.database.url();
    let folder = second.kill();
    let again = ServerConfig {
        database: url,
        objects: Some(objects),
        ..ServerConfig::new(folder.path())
    };
    let again = eventually("the lock of the killed one's folder", async || {
        Coordinator::open(again.clone()).await.ok()
    });
    let again = again.await;
    assert_eq!(state(&third).await, (job::State::Queued, 1));
    again.close().await;
}

#[tokio::test]
async fn two_coordinators_share_a_bucket() {
    let server = Server::start();
    let settings = |config: &mut ServerConfig| {
        let url = Url::parse(&format!("s3://{BUCKET}/yoto")).expect("a URL");
        config.objects = Some(url);
        config.environment = server.environment().into();
    };
    let first = Service::start_with(settings).await;
    let Some(second) = first.beside_with(settings).await else {
        return;
    };
    let (_, name) = half_of_an_upload(&first).await;
    second.write(other_half(&name)).await.expect("goes on");
    first.finish(&name).await.expect("is complete");
    let other = Url::parse(&format!("s3://{BUCKET}/other")).expect("a URL");
    let dir = tempfile::tempdir().expect("a folder");
    let config = ServerConfig {
        database: first.database.url(),
        objects: Some(other),
        environment: server.environment().into(),
        ..ServerConfig::new(dir.path())
    };
    let opened = Coordinator::open(config).await.map(drop);
    let opened = opened.expect_err("has another prefix");
    assert!(names_other_objects(&opened), "{opened}");
}

#[tokio::test]
async fn a_coordinator_with_other_objects_is_refused() {
    let first = Service::start().await;
    let Some(url) = first.database.url() else {
        return;
    };
    let dir = tempfile::tempdir().expect("a folder");
    let config = ServerConfig {
        database: Some(url),
        ..ServerConfig::new(dir.path())
    };
    let opened = Coordinator::open(config).await.map(drop);
    let error = opened.expect_err("it has no objects of this database");
    assert!(names_other_objects(&error), "{error}");
    let told = error.to_string();
    assert!(told.contains("begun with another store"), "{told}");
}
