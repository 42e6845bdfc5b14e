//! Backups of a service that runs, and their restoration.

use crate::support::{Database, Service, chunk, eventually, file};
use std::path::Path;
use tempfile::TempDir;
use yoto_proto::v1::{EraseSubjectRequest, GetErasureRequest, GetSubjectRequest, job};
use yoto_server::backup::{BackupError, Place, backup, restore};
use yoto_server::{ErasedPerson, erased_in_folder, erased_in_postgres};

fn place(folder: &Path, database: &Database) -> Place {
    Place {
        data_dir: folder.to_owned(),
        database: database.url(),
        objects: true,
    }
}

#[tokio::test]
async fn a_backup_of_a_running_service_is_a_service_at_one_point() {
    let service = Service::start().await;
    let subject = service.ready_subject("Ada").await;
    let model = service.model_of(&subject).await;
    let job = service.train(&model).await;
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("the training waits");
    service.publish(&lease, 3).await.expect("holds the lease");
    let folder = TempDir::new().expect("a folder");
    let saved = folder.path().join("saved");
    let from = place(service.dir.path(), &service.database);
    let copied = backup(&from, &saved).await.expect("copies");
    let stored = service.stored_files().len() as u64;
    assert_eq!(
        copied.objects,
        stored + 1,
        "all that there is, and the store's name"
    );
    let later = service.subject("Bob").await;

    let again = TempDir::new().expect("a folder");
    let database = Database::of(again.path());
    let to = place(again.path(), &database);
    let restored = restore(&saved, &to, &[]).await.expect("copies back");
    assert_eq!(restored.copied, copied);
    database.keep(again.path());
    let restored = Service::start_in(again, |_| {}).await;
    assert_eq!(restored.get_subject(&subject.name).await, subject);
    assert_eq!(restored.stored_files().len() as u64, stored);
    let request = GetSubjectRequest { name: later.name };
    let unknown = restored.subjects().get_subject(request).await;
    unknown.expect_err("came after the backup");
    // Its worker may still be there: the lease goes on in the copy as well.
    let running = restored.get_job(&job.name).await;
    assert_eq!(running.state(), job::State::Running);
    restored.publish(&lease, 5).await.expect("holds the lease");
}

#[tokio::test]
async fn who_was_erased_after_the_backup_does_not_come_back() {
    let service = Service::start().await;
    let ada = service.subject("Ada").await;
    let bob = service.subject("Bob").await;
    let folder = TempDir::new().expect("a folder");
    let saved = folder.path().join("saved");
    let from = place(service.dir.path(), &service.database);
    backup(&from, &saved).await.expect("copies");
    let erase = EraseSubjectRequest {
        name: ada.name.clone(),
        display_name: "Ada".into(),
        ..EraseSubjectRequest::default()
    };
    let erased = service.subjects().erase_subject(erase).await;
    let erased = erased.expect("is erased").into_inner();
    let people = match service.database.url() {
        Some(url) => erased_in_postgres(&url).await,
        None => erased_in_folder(service.dir.path()).await,
    };
    let people = people.expect("reads");
    let only = ErasedPerson {
        erasure: erased.name,
        subject: ada.name.clone(),
    };
    assert_eq!(people, [only]);
    // The report that the operator has kept says the same. A busy service writes it after the answer.
    let erased = eventually("the report", async || {
        let request = GetErasureRequest {
            name: people[0].erasure.clone(),
        };
        let found = service.subjects().get_erasure(request).await;
        let found = found.expect("is there").into_inner();
        (!found.report.is_empty()).then_some(found)
    });
    let erased = erased.await;
    let report: ErasedPerson = serde_json::from_str(&erased.report).expect("has the fields");
    assert_eq!(people, [report]);

    let again = TempDir::new().expect("a folder");
    let database = Database::of(again.path());
    let to = place(again.path(), &database);
    let restored = restore(&saved, &to, &people).await.expect("copies back");
    assert_eq!(restored.erased, 1);
    database.keep(again.path());
    let restored = Service::start_in(again, |_| {}).await;
    eventually("they are erased again", || async {
        let request = GetSubjectRequest {
            name: ada.name.clone(),
        };
        restored.subjects().get_subject(request).await.err()
    })
    .await;
    eventually("nothing of them is left", || async {
        restored.residue("Ada").await.is_empty().then_some(())
    })
    .await;
    restored.get_subject(&bob.name).await;
}

#[tokio::test]
async fn rows_of_sqlite_are_carried_to_postgres() {
    let service = Service::start().await;
    if service.database.url().is_some() || !yoto_test_postgres::is_there() {
        return;
    }
    let trained = service.trained().await;
    let files = [file("poses.json", b"{}"), file("video.mp4", b"0123")];
    let upload = service.open_upload(&trained.subject.name, &files).await;
    let upload = upload.expect("is opened").name;
    let half = vec![chunk(&upload, "video.mp4", 0, b"01")];
    service.write(half).await.expect("is committed");
    let folder = TempDir::new().expect("a folder");
    let saved = folder.path().join("saved");
    let from = place(service.dir.path(), &service.database);
    backup(&from, &saved).await.expect("copies");

    let again = TempDir::new().expect("a folder");
    let made = yoto_test_postgres::Database::create();
    let database = Database::Postgres(made.expect("PostgreSQL"));
    let to = place(again.path(), &database);
    restore(&saved, &to, &[]).await.expect("carries");
    let onto = TempDir::new().expect("a folder");
    let filled = restore(&saved, &place(onto.path(), &database), &[]).await;
    assert!(
        matches!(filled, Err(BackupError::RowsThere { .. })),
        "{filled:?}"
    );
    database.keep(again.path());
    let carried = Service::start_in(again, |_| {}).await;
    let subject = carried.get_subject(&trained.subject.name).await;
    assert_eq!(subject.display_name, trained.subject.display_name);
    let checkpoints = carried.checkpoints(&trained.model.name).await;
    assert_eq!(checkpoints, service.checkpoints(&trained.model.name).await);
    // The lease and the upload go on, and new rows come after the carried ones.
    let later = carried.publish(&trained.training, 5).await;
    later.expect("holds the lease");
    let rest = vec![
        chunk(&upload, "video.mp4", 2, b"23"),
        chunk(&upload, "poses.json", 0, b"{}"),
    ];
    carried.write(rest).await.expect("goes on");
    carried.finish(&upload).await.expect("is complete");
    let job = carried.train(&trained.model).await;
    assert_eq!(job.queue_position, 1);
}

#[tokio::test]
async fn a_backup_goes_only_where_nothing_is_and_comes_only_from_a_whole_one() {
    let service = Service::start().await;
    let from = place(service.dir.path(), &service.database);
    let folder = TempDir::new().expect("a folder");
    std::fs::write(folder.path().join("letter.txt"), "dear").expect("writes");
    let full = backup(&from, folder.path()).await;
    assert!(matches!(full, Err(BackupError::NotEmpty(_))), "{full:?}");

    // Into its own objects it would copy itself.
    for inside in ["objects/x", "objects/deeper/y"] {
        let inside = service.dir.path().join(inside);
        let refused = backup(&from, &inside).await;
        assert!(
            matches!(refused, Err(BackupError::Inside(..))),
            "{refused:?}"
        );
        assert!(!inside.exists());
    }

    let other = TempDir::new().expect("a folder");
    let target = Place {
        data_dir: other.path().join("data"),
        database: None,
        objects: true,
    };
    let none = restore(folder.path(), &target, &[]).await;
    assert!(matches!(none, Err(BackupError::NoBackup(_))), "{none:?}");
    let empty = Place {
        data_dir: other.path().to_owned(),
        ..target.clone()
    };
    let none = backup(&empty, &other.path().join("saved")).await;
    assert!(matches!(none, Err(BackupError::NoService(_))), "{none:?}");

    let saved = folder.path().join("saved");
    backup(&from, &saved).await.expect("copies");
    let onto = restore(&saved, &from, &[]).await;
    assert!(
        matches!(
            onto,
            Err(BackupError::NotEmpty(_) | BackupError::Program { .. })
        ),
        "{onto:?}"
    );
}

#[tokio::test]
async fn objects_in_another_store_are_not_left_out_silently() {
    let elsewhere = TempDir::new().expect("a folder");
    let url = url::Url::from_directory_path(elsewhere.path()).expect("a URL");
    let service = Service::start_with(|config| config.objects = Some(url)).await;
    service.ready_subject("Ada").await;
    let folder = TempDir::new().expect("a folder");
    let from = place(service.dir.path(), &service.database);
    let without = backup(&from, &folder.path().join("all")).await;
    assert!(
        matches!(without, Err(BackupError::NoObjects(_))),
        "{without:?}"
    );
    let rows = Place {
        objects: false,
        ..from
    };
    let copied = backup(&rows, &folder.path().join("rows")).await;
    assert_eq!(copied.expect("copies rows").objects, 0);
}
