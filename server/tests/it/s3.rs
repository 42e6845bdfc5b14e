//! S3: all tests of this program again, and what only a remote store does.

use crate::support::{ON_POSTGRES, ON_S3, Service, assert_refused, chunks, file};
use std::process::Command;
use tonic::Code;
use url::Url;
use yoto_proto::v1::GetStatusRequest;
use yoto_proto::v1::status_service_client::StatusServiceClient;
use yoto_server::fsck::{Place, fsck};
use yoto_server::{Coordinator, PostgresUrl, ServerConfig};
use yoto_test_s3::{BUCKET, S3Fault, Server};

/// Tests of what only a folder has: its kind and its room, its owner, files of a writer that was killed, a file in
/// its place, another name for it, and a copy of it.
const OF_FOLDERS: &[&str] = &[
    "backups::a_backup_goes_only_where_nothing_is_and_comes_only_from_a_whole_one",
    "backups::a_backup_of_a_running_service_is_a_service_at_one_point",
    "backups::rows_of_sqlite_are_carried_to_postgres",
    "backups::who_was_erased_after_the_backup_does_not_come_back",
    "garbage::the_remains_of_a_killed_writer_and_empty_folders_go",
    "pages::a_coordinator_without_its_database_or_its_objects_is_not_ready",
    "pages::figures_tell_the_queue_and_what_happened",
    "service::files_are_accessible_to_the_service_s_user_alone",
    "service::large_messages_pass_and_inner_errors_stay_inside",
    "status::the_status_counts_jobs_and_knows_who_asks_for_them",
];

#[test]
fn all_of_this_holds_on_s3_too() {
    if [ON_S3, ON_POSTGRES]
        .iter()
        .any(|it| std::env::var_os(it).is_some())
    {
        return;
    }
    let server = Server::start();
    let program = std::env::current_exe().expect("this program");
    let skipped = OF_FOLDERS.iter().flat_map(|it| ["--skip", it]);
    let ran = Command::new(program)
        .args(skipped)
        .envs(server.environment())
        .env(ON_S3, server.folder())
        .output()
        .expect("starts");
    let said = String::from_utf8_lossy(&ran.stdout);
    assert!(ran.status.success(), "{said}");
    assert!(said.contains("test result: ok"), "{said}");
}

/// A service on S3, and the server that has its objects.
async fn service_and_server(change: impl FnOnce(&mut ServerConfig)) -> (Service, Server) {
    let server = Server::start();
    let url = Url::parse(&format!("s3://{BUCKET}/yoto")).expect("a URL");
    let environment = server.environment();
    let service = Service::start_with(|config| {
        config.objects = Some(url);
        config.environment = environment.into();
        change(config);
    });
    (service.await, server)
}

#[tokio::test]
async fn a_store_that_is_down_is_unavailable_and_costs_nothing() {
    let (service, server) = service_and_server(|_| {}).await;
    let ada = service.subject("Ada").await;
    let files = [file("poses.json", b"{}"), file("a", b"frame")];
    let upload = service.open_upload(&ada.name, &files).await;
    let upload = upload.expect("is opened").name;
    server.fail(S3Fault::Unavailable);
    let down = service.write(chunks(&upload, &files)).await;
    assert_refused(down, Code::Unavailable, "STORE_UNAVAILABLE");
    server.heal();
    server.deny(&["PutObject"]);
    let denied = service.write(chunks(&upload, &files)).await;
    assert_refused(denied, Code::Unavailable, "STORE_UNAVAILABLE");
    server.deny(&[]);
    let written = service.write(chunks(&upload, &files)).await;
    written.expect("the upload is open still");
    server.fail(S3Fault::Unavailable);
    let down = service.finish(&upload).await;
    assert_refused(down, Code::Unavailable, "STORE_UNAVAILABLE");
    server.heal();
    service.finish(&upload).await.expect("nothing was lost");
    let lease = service.ingest_lease().await;
    let part = &lease.inputs.expect("has inputs").parts[0];
    let stored = std::fs::read(server.folder().join("yoto").join(&part.key));
    let stored = stored.expect("is stored");
    assert!(stored.ends_with(b"frame"), "{stored:?}");
}

#[tokio::test]
async fn a_limit_takes_the_place_of_free_space() {
    let (service, _server) = service_and_server(|config| {
        config.storage.limit_bytes = Some(1000);
        config.storage.min_free_bytes = 100;
    })
    .await;
    let ada = service.subject("Ada").await;
    let large = vec![file("poses.json", b"{}"), file("a", &[7; 850])];
    service
        .upload(&ada.name, large.clone())
        .await
        .expect("fits");
    service.collect(true, false).await;
    let mut client = StatusServiceClient::new(service.channel.clone());
    let status = client.get_status(GetStatusRequest {}).await;
    let status = status.expect("answers").into_inner();
    assert_eq!(
        (status.disk_free, status.disk_total),
        (Some(148), Some(1000))
    );
    let more = service.upload(&ada.name, large).await;
    assert_refused(more, Code::ResourceExhausted, "DISK_FULL");
}

#[tokio::test]
async fn a_store_that_can_not_be_used_is_told_at_the_start() {
    let server = Server::start();
    server.deny(&["DeleteObjects"]);
    let dir = tempfile::tempdir().expect("a folder");
    let mut config = ServerConfig::new(dir.path());
    config.objects = Some(Url::parse(&format!("s3://{BUCKET}/yoto")).expect("a URL"));
    config.environment = server.environment().into();
    let Err(refused) = Coordinator::open(config).await else {
        panic!("garbage could never be removed");
    };
    assert!(refused.to_string().contains("s3:DeleteObject"), "{refused}");
}

#[tokio::test]
async fn rows_in_postgresql_and_objects_in_s3_are_checked_together() {
    let Some(database) = yoto_test_postgres::Database::create() else {
        return;
    };
    let url: PostgresUrl = database.url().parse().expect("an address");
    let (service, server) = service_and_server(|config| config.database = Some(url.clone())).await;
    let ada = service.subject("Ada").await;
    let files = vec![file("poses.json", b"{}"), file("a", b"frame")];
    service.upload(&ada.name, files).await.expect("arrives");
    let place = Place {
        data_dir: service.dir.path().to_owned(),
        database: Some(url),
        objects: Some(service.coordinator.objects_url().clone()),
        environment: server.environment().into(),
    };
    let report = fsck(&place, |_| {}).await.expect("can be read");
    assert!(report.is_sound(), "{report:?}");
    assert!(report.objects > 0);
    server.deny(&["GetObject"]);
    let denied = fsck(&place, |_| {}).await.expect_err("can't be read");
    assert!(denied.to_string().contains("yoto-store"), "{denied}");
    server.deny(&[]);
    std::fs::remove_dir_all(server.folder().join("yoto/uploads")).expect("removes");
    let report = fsck(&place, |_| {}).await.expect("can be read");
    assert_eq!(report.missing.len(), 1, "{report:?}");
}
