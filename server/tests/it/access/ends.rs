//! Keys that end: running streams end with them, also those at other coordinators, and a key that was revoked does not open a
//! service again.

use crate::support::{Made, Service, assert_refused, chunk, eventually, file};
use futures::stream::{self, StreamExt};
use std::time::Duration;
use tonic::transport::Channel;
use tonic::{Code, Status, Streaming};
use yoto_proto::key::{Connection, connection};
use yoto_proto::v1::job_service_client::JobServiceClient;
use yoto_proto::v1::key_service_client::KeyServiceClient;
use yoto_proto::v1::status_service_client::StatusServiceClient;
use yoto_proto::v1::upload_service_client::UploadServiceClient;
use yoto_proto::v1::{
    CordonWorkerRequest, CreateKeyRequest, DrainRequest, GetStatusRequest, JobKind,
    ListJobsRequest, ListKeysRequest, PauseJobsRequest, RevokeKeyRequest, Scope, WatchJobRequest,
    WatchJobResponse,
};
use yoto_server::{Admission, KeyStore};

/// A watch of a job that waits for ever, after its first answer.
async fn watch(service: &Service, connection: Connection) -> Streaming<WatchJobResponse> {
    let subject = service.ready_subject("Ada").await;
    let job = service.train(&service.model_of(&subject).await).await;
    let request = WatchJobRequest {
        name: job.name,
        after_sequence: 0,
    };
    let watched = JobServiceClient::new(connection).watch_job(request).await;
    let mut watched = watched.expect("is watched").into_inner();
    let first = watched.message().await.expect("goes on");
    assert!(first.is_some());
    watched
}

/// The status with which a stream ends.
async fn end(mut stream: Streaming<WatchJobResponse>) -> Result<(), Status> {
    let over = async {
        while stream.message().await?.is_some() {}
        Ok(())
    };
    let over = tokio::time::timeout(Duration::from_secs(20), over).await;
    over.expect("ends")
}

async fn lists(connection: Connection) -> Result<(), Status> {
    let listed = JobServiceClient::new(connection)
        .list_jobs(ListJobsRequest::default())
        .await;
    listed.map(drop)
}

#[tokio::test]
async fn a_revocation_ends_calls_and_streams() {
    let service = Service::start().await;
    let key = service.key("default", &[Scope::Read, Scope::Write]).await;
    let watched = watch(&service, service.with_key(&key)).await;
    let subject = service.subject("Bob").await;
    let files = [file("poses.json", b"{}")];
    let upload = service.open_upload(&subject.name, &files).await;
    let upload = upload.expect("is opened").name;
    // A stream of requests that never ends.
    let sent = stream::iter([chunk(&upload, "poses.json", 0, b"{")]).chain(stream::pending());
    let mut uploads = UploadServiceClient::new(service.with_key(&key));
    let writing = tokio::spawn(async move { uploads.write_upload(sent).await });
    lists(service.with_key(&key)).await.expect("may");
    service.revoke(&key.name).await;
    assert_refused(
        lists(service.with_key(&key)).await,
        Code::Unauthenticated,
        "KEY_REVOKED",
    );
    assert_refused(end(watched).await, Code::Unauthenticated, "KEY_REVOKED");
    let written = writing.await.expect("no panic");
    assert_refused(written, Code::Unauthenticated, "KEY_REVOKED");
    // It was the only key.
    let anyone = connection(service.door(Admission::Anyone), None);
    assert_refused(lists(anyone).await, Code::Unauthenticated, "KEY_MISSING");
}

#[tokio::test]
async fn the_first_key_ends_the_streams_of_those_without_one() {
    let service = Service::start().await;
    let anyone = connection(service.door(Admission::Anyone), None);
    let watched = watch(&service, anyone).await;
    service.key("default", &[Scope::Read]).await;
    assert_refused(end(watched).await, Code::Unauthenticated, "KEY_MISSING");
}

#[tokio::test]
async fn a_key_ends_with_its_time() {
    let service = Service::start().await;
    let key = service.key("default", &[Scope::Read]).await;
    let watched = watch(&service, service.with_key(&key)).await;
    let id = key.name.trim_start_matches("keys/");
    let ended = format!("UPDATE keys SET expire_time = 1.5 WHERE id = '{id}'");
    service.database.run(&ended).await;
    assert_refused(end(watched).await, Code::Unauthenticated, "KEY_EXPIRED");
}

/// The revocation in the database by another process is seen by a running service.
#[tokio::test]
async fn a_key_that_another_process_makes_or_revokes_counts_here() {
    let service = Service::start().await;
    let beside = service.beside().await;
    let key = service.key("default", &[Scope::Read]).await;
    let watched = watch(&service, service.with_key(&key)).await;
    match &beside {
        // The other coordinator of a database of PostgreSQL.
        Some(other) => {
            eventually("the key", || async {
                lists(other.with_key(&key)).await.ok()
            })
            .await;
            other.revoke(&key.name).await;
        }
        None => {
            let keys = KeyStore::in_folder(service.dir.path())
                .await
                .expect("opens");
            keys.revoke(&key.name).await.expect("is revoked");
            keys.close().await;
        }
    }
    assert_refused(end(watched).await, Code::Unauthenticated, "KEY_REVOKED");
    assert_refused(
        lists(service.with_key(&key)).await,
        Code::Unauthenticated,
        "KEY_REVOKED",
    );
}

/// The keys that a caller sees.
async fn seen(service: &Service, by: &Made, tenant: &str) -> Result<Vec<String>, Status> {
    let request = ListKeysRequest {
        tenant: tenant.into(),
        ..ListKeysRequest::default()
    };
    let mut keys = KeyServiceClient::new(service.with_key(by));
    let listed = keys.list_keys(request).await?.into_inner().keys;
    Ok(listed.into_iter().map(|it| it.name).collect())
}

#[tokio::test]
async fn operators_manage_the_keys_of_their_tenant_and_those_of_the_service_all() {
    let service = Service::start().await;
    let first = service.key("default", &[Scope::Operate]).await;
    let other = service.key("other", &[Scope::Operate]).await;
    assert_eq!(
        seen(&service, &other, "").await.expect("may"),
        std::slice::from_ref(&other.name)
    );
    let refused = seen(&service, &other, "default").await;
    assert_refused(refused, Code::PermissionDenied, "SCOPE_MISSING");
    assert_eq!(
        seen(&service, &first, "other").await.expect("may"),
        std::slice::from_ref(&other.name)
    );
    let revoke = async |by: &Made, name: &str| {
        let request = RevokeKeyRequest { name: name.into() };
        KeyServiceClient::new(service.with_key(by))
            .revoke_key(request)
            .await
    };
    let refused = revoke(&other, &first.name).await;
    assert_refused(refused, Code::NotFound, "NOT_FOUND");
    revoke(&first, &other.name).await.expect("may");
    let again = revoke(&first, &other.name).await.expect("changes nothing");
    assert!(again.into_inner().revoke_time.is_some());
}

#[tokio::test]
async fn the_use_of_a_key_is_noted() {
    let service = Service::start().await;
    let key = service.key("default", &[Scope::Read]).await;
    let used = async || {
        let mut keys: KeyServiceClient<Channel> = service.keys();
        let listed = keys.list_keys(ListKeysRequest::default()).await;
        let listed = listed.expect("lists").into_inner().keys;
        listed[0].last_use_time
    };
    assert_eq!(used().await, None);
    lists(service.with_key(&key)).await.expect("may");
    let first = eventually("the note", used).await;
    for _ in 0..20 {
        lists(service.with_key(&key)).await.expect("may");
    }
    assert_eq!(used().await, Some(first), "it is not noted at each call");
}

#[tokio::test]
async fn a_key_makes_none_with_a_scope_that_it_lacks() {
    let service = Service::start().await;
    let make = async |key: &Made, scopes: &[Scope]| {
        let request = CreateKeyRequest {
            display_name: "new".into(),
            scopes: scopes.iter().map(|it| i32::from(*it)).collect(),
            ..CreateKeyRequest::default()
        };
        let mut keys = KeyServiceClient::new(service.with_key(key));
        keys.create_key(request).await
    };
    let figures = service.key("default", &[Scope::Operate]).await;
    for scope in [Scope::Read, Scope::Write] {
        let refused = make(&figures, &[scope, Scope::Operate]).await;
        assert_refused(refused, Code::PermissionDenied, "SCOPE_MISSING");
    }
    make(&figures, &[Scope::Operate]).await.expect("its own");
    make(&figures, &[Scope::Work]).await.expect("a worker's");
    let admin = [Scope::Read, Scope::Write, Scope::Operate];
    let admin = service.key("default", &admin).await;
    make(&admin, &[Scope::Read, Scope::Write])
        .await
        .expect("its own");
}

#[tokio::test]
async fn what_keeps_jobs_from_being_taken_names_the_key_that_said_so() {
    let service = Service::start().await;
    let key = service.key("default", &[Scope::Operate]).await;
    let connection = || service.with_key(&key);
    let pause = PauseJobsRequest {
        kind: JobKind::Export.into(),
        ..PauseJobsRequest::default()
    };
    let paused = JobServiceClient::new(connection()).pause_jobs(pause).await;
    paused.expect("is paused");
    let mut operator = StatusServiceClient::new(connection());
    let drain = DrainRequest::default();
    operator.drain(drain).await.expect("is drained");
    let cordon = CordonWorkerRequest {
        display_name: "w".into(),
        ..CordonWorkerRequest::default()
    };
    operator.cordon_worker(cordon).await.expect("is cordoned");
    let mut own = StatusServiceClient::new(service.channel.clone());
    let status = own.get_status(GetStatusRequest {}).await;
    let status = status.expect("answers").into_inner();
    let said = [
        status.paused[0].by.as_str(),
        &status.draining.as_ref().expect("is drained").by,
        &status.cordons[0].by,
    ];
    assert_eq!(said, [key.name.as_str(); 3]);
}
