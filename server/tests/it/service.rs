//! The service as a whole: one process per folder, state that outlives it, health, reflection.

use crate::support;
use crate::support::{Database, Service, assert_invalid, eventually, file, job_name};
use futures::stream;
use std::time::Duration;
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio_stream::StreamExt;
use tonic::Code;
use tonic::transport::Endpoint;
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_check_response::ServingStatus;
use tonic_health::pb::health_client::HealthClient;
use tonic_reflection::pb::v1::ServerReflectionRequest;
use tonic_reflection::pb::v1::server_reflection_client::ServerReflectionClient;
use tonic_reflection::pb::v1::server_reflection_request::MessageRequest;
use tonic_reflection::pb::v1::server_reflection_response::MessageResponse;
use yoto_proto::v1::subject_service_client::SubjectServiceClient;
use yoto_proto::v1::{GetSubjectRequest, JobKind, ListJobsRequest, WorkerDevice, job};
use yoto_proto::worker::v1::RegisterWorkerRequest;
use yoto_proto::worker::v1::worker_service_client::WorkerServiceClient;
use yoto_server::{Coordinator, ServerConfig, ServerError};

#[tokio::test]
async fn a_second_coordinator_on_the_same_folder_is_refused() {
    let service = Service::start().await;
    let second = Coordinator::open(ServerConfig::new(service.dir.path())).await;
    let Err(error @ ServerError::DataDirInUse { .. }) = second else {
        panic!("the folder is in use");
    };
    let folder = service.dir.path().canonicalize().expect("is there");
    let message = error.to_string();
    assert!(message.contains(&folder.display().to_string()), "{message}");
    assert!(message.contains("in use"), "{message}");
    let dir = service.stop().await;
    Service::start_in(dir, |_| {}).await;
}

#[tokio::test]
async fn what_was_answered_survives_a_restart() {
    let service = Service::start().await;
    let subject = service.ready_subject("Ada").await;
    let model = service.model_of(&subject).await;
    let queued = service.train(&model).await;
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("the training waits");
    let dir = service.stop().await;
    let service = Service::start_in(dir, |_| {}).await;
    assert_eq!(service.get_subject(&subject.name).await, subject);
    let job = service.get_job(&queued.name).await;
    assert_eq!(job.state(), job::State::Running);
    // The worker never noticed: its lease still holds.
    service.publish(&lease, 3).await.expect("holds the lease");
    assert_eq!(job_name(&lease), queued.name);
}

#[tokio::test]
async fn health_and_reflection_answer() {
    let service = Service::start().await;
    let mut health = HealthClient::new(service.channel.clone());
    for name in ["", "yoto.v1.JobService", "yoto.worker.v1.WorkerService"] {
        let request = HealthCheckRequest {
            service: name.into(),
        };
        let answer = health.check(request).await.expect("answers").into_inner();
        assert_eq!(answer.status(), ServingStatus::Serving, "{name}");
    }
    let request = ServerReflectionRequest {
        host: String::new(),
        message_request: Some(MessageRequest::ListServices(String::new())),
    };
    let mut reflection = ServerReflectionClient::new(service.channel.clone());
    let call = reflection
        .server_reflection_info(stream::iter([request]))
        .await;
    let answer = call
        .expect("answers")
        .into_inner()
        .next()
        .await
        .expect("an item");
    let Some(MessageResponse::ListServicesResponse(list)) =
        answer.expect("no error").message_response
    else {
        panic!("services were asked for");
    };
    let names: Vec<_> = list
        .service
        .into_iter()
        .map(|service| service.name)
        .collect();
    assert!(names.contains(&"yoto.worker.v1.WorkerService".to_owned()));
    for name in ["Subject", "Model", "Job", "Render"] {
        assert!(
            names.contains(&format!("yoto.v1.{name}Service")),
            "{name} in {names:?}"
        );
    }
}

#[tokio::test]
async fn health_follows_whether_the_database_takes_writes() {
    let start = |config: &mut ServerConfig| config.health_interval = Duration::from_millis(20);
    let service = Service::start_with(start).await;
    let told = |wanted: ServingStatus| {
        let channel = service.channel.clone();
        let ask = move || {
            let mut health = HealthClient::new(channel.clone());
            async move {
                let request = HealthCheckRequest {
                    service: "yoto.v1.JobService".into(),
                };
                let answer = health.check(request).await.expect("answers").into_inner();
                (answer.status() == wanted).then_some(())
            }
        };
        async move { eventually(wanted.as_str_name(), ask).await }
    };
    let locked = service.database.lock_writes().await;
    told(ServingStatus::NotServing).await;
    service
        .jobs()
        .list_jobs(ListJobsRequest::default())
        .await
        .expect("reads go on");
    locked.release().await;
    told(ServingStatus::Serving).await;
}

#[cfg(unix)]
#[tokio::test]
async fn files_are_accessible_to_the_service_s_user_alone() {
    use std::os::unix::fs::MetadataExt;
    let dir = TempDir::new().expect("a folder");
    let data = dir.path().join("new/data");
    let own = data.clone();
    let service = Service::start_in(dir, move |config| config.data_dir = own).await;
    let subject = service.subject("Ada").await;
    service.upload_good(&subject.name).await;
    let upload = data.join("objects/uploads");
    let upload = std::fs::read_dir(upload)
        .expect("a folder")
        .next()
        .expect("an upload")
        .expect("an entry")
        .path();
    let others = |path: &std::path::Path| {
        let mode = std::fs::metadata(path).expect("is there").mode();
        mode & 0o077
    };
    let mut paths = vec!["", "..", "lock", "objects", "objects/uploads"];
    if let Database::Sqlite(_) = service.database {
        paths.extend(["yoto.db", "yoto.db-wal", "yoto.db-shm"]);
    }
    for path in paths {
        assert_eq!(others(&data.join(path)), 0, "{path}");
    }
    assert_eq!(others(&upload), 0);
    assert_eq!(others(&upload.join("parts")), 0);
}

#[tokio::test]
async fn one_coordinator_serves_tcp_beside_memory_and_drains_alone() {
    let service = Service::start().await;
    let subject = service.subject("Ada").await;
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("binds");
    let address = listener.local_addr().expect("has an address");
    let (stop, stopped) = tokio::sync::oneshot::channel::<()>();
    let shutdown = async {
        stopped.await.expect("is told");
    };
    let serving = tokio::spawn(
        service
            .coordinator
            .serve(yoto_server::tcp(listener), shutdown),
    );
    let endpoint = Endpoint::from_shared(format!("http://{address}")).expect("an address");
    let channel = endpoint.connect().await.expect("connects");
    let request = GetSubjectRequest {
        name: subject.name.clone(),
    };
    let seen = SubjectServiceClient::new(channel.clone())
        .get_subject(request)
        .await
        .expect("is there");
    assert_eq!(seen.into_inner(), subject);
    // Another process can't be embedded: its jobs would be taken back at the next start of the service.
    let request = RegisterWorkerRequest {
        display_name: "far".into(),
        device: Some(WorkerDevice::default()),
        kinds: vec![JobKind::Train.into()],
        embedded: true,
        ..<_>::default()
    };
    let mut workers = WorkerServiceClient::new(channel);
    assert_invalid(workers.register_worker(request.clone()).await, "embedded");
    let near = service.workers().register_worker(request).await;
    near.expect("is in this process");
    stop.send(()).expect("is heard");
    serving.await.expect("no panic").expect("ends in order");
    assert_eq!(
        service.get_subject(&subject.name).await,
        subject,
        "memory is served on"
    );
}

#[tokio::test]
async fn large_messages_pass_and_inner_errors_stay_inside() {
    let service = Service::start().await;
    let subject = service.subject("Ada").await;
    let large = file("frames/0.png", &vec![7; 6 << 20]);
    let small = [file("poses.json", b"{}"), file("empty", b"")];
    let files: Vec<_> = small.iter().cloned().chain([large.clone()]).collect();
    let upload = service.open_upload(&subject.name, &files).await;
    let upload = upload.expect("is opened").name;
    let mut messages = support::chunks(&upload, &small);
    // More than tonic's default limit of 4 MiB in one chunk.
    messages.push(support::chunk(&upload, &large.path, 0, &large.bytes));
    service
        .write(messages)
        .await
        .expect("a large chunk is fine");
    let finished = service.finish(&upload).await;
    finished.expect("an empty file is fine");

    let worker = service.worker(&["ingest"]).await;
    let objects = service.dir.path().join("objects");
    std::fs::remove_dir_all(&objects).expect("breaks the store");
    std::fs::write(&objects, b"a file where a folder was").expect("breaks the store");
    let status = service
        .upload(&subject.name, vec![file("poses.json", b"{}")])
        .await;
    let status = status.expect_err("the store is broken");
    assert_eq!(status.code(), Code::Internal);
    assert!(!status.message().contains("objects"), "{status}");
    service
        .jobs()
        .list_jobs(ListJobsRequest::default())
        .await
        .expect("the service lives on");
    let lease = service.lease(&worker).await;
    assert!(lease.is_some(), "the job of the good upload waits");
}
