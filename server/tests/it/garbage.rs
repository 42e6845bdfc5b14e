//! Objects are removed once nothing refers to them, and never before.

use crate::support;
use crate::support::{Service, Trained, assert_refused, chunks, file, headers, id, job_name};
use std::fs;
use std::sync::Arc;
use std::time::Duration;
use tonic::Code;
use yoto_proto::keys;
use yoto_proto::v1::{
    CreateJobRequest, CreateUploadRequest, DeleteJobRequest, JobSpec, TrainSpec, job_spec,
};
use yoto_proto::worker::v1::end_job_request::Outcome;
use yoto_server::ServerConfig;
use yoto_server::clock::ManualClock;

const HOUR: Duration = Duration::from_secs(3600);

/// Garbage goes at once; only the best and newest checkpoints are kept.
fn at_once(config: &mut ServerConfig) {
    config.storage.grace = Duration::ZERO;
    config.storage.collect_interval = HOUR;
    config.storage.keep_newest = 1;
    config.storage.keep_every = 0;
    config.storage.keep_uploads = Duration::ZERO;
}

#[tokio::test]
async fn garbage_waits_for_its_time() {
    let service = Service::start_with(|config| {
        at_once(config);
        config.storage.grace = HOUR;
    })
    .await;
    let ada = service.ready_subject("Ada").await;
    let model = service.model_of(&ada).await;
    service.train(&model).await;
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("the training waits");
    let first = service
        .publish_with(&lease, 1, 20.0)
        .await
        .expect("publishes");
    let second = service
        .publish_with(&lease, 2, 30.0)
        .await
        .expect("publishes");
    let manifest = |it: &yoto_proto::v1::Checkpoint| it.manifest.clone().expect("has one");
    // Its weights and its manifest.
    let bytes = first.bytes + manifest(&first).bytes;
    let (first, second) = (manifest(&first).key, manifest(&second).key);
    let lost = "renders/somebody/3";
    service.put(&format!("{lost}/000000.png"), b"lost").await;

    // The second call has the notes of the first.
    for _ in 0..2 {
        let found = service.collect(false, false).await;
        assert!(
            found
                .folders
                .iter()
                .all(|it| !it.due && it.age_seconds < 60.0)
        );
        let listed = |key: &str| found.folders.iter().find(|it| it.key == key);
        let removed = listed(keys::folder(&first)).expect("no longer kept");
        assert_eq!(
            (removed.deleted, removed.files, removed.bytes),
            (true, 2, bytes)
        );
        assert!(!listed(lost).expect("nobody's").deleted);
        assert!(listed(keys::folder(&second)).is_none());
        assert_eq!(found.due_bytes, 0);
    }
    let told = service.collect(true, true).await;
    assert_eq!(told.due_bytes, bytes, "what was deleted would go");
    assert!(service.has(&first) && service.has(lost));
    let done = service.collect(false, true).await;
    assert_eq!(done.due_bytes, bytes);
    assert!(!service.has(keys::folder(&first)) && service.has(lost));
    assert!(service.has(&second));

    // The same age is enough now.
    let dir = service.stop().await;
    let service = Service::start_in(dir, at_once).await;
    service.collect(false, false).await;
    assert!(!service.has(lost) && !service.has("renders"));
    assert!(service.has(&second), "its row names it");
    assert_eq!(service.collect(false, false).await.count, 0);
}

#[tokio::test]
async fn what_a_running_job_writes_is_not_garbage_until_it_ends() {
    let service = Service::start_with(at_once).await;
    let ada = service.ready_subject("Ada").await;
    let model = service.model_of(&ada).await;
    let job = service.train(&model).await;
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("the training waits");
    let folder = |token| keys::checkpoint(id(&model.name), id(&job.name), token, 5);
    let (own, other) = (folder(lease.token), folder(lease.token + 1));
    for folder in [&own, &other] {
        service.put(&format!("{folder}/weights"), b"weights").await;
    }
    service.collect(false, false).await;
    assert!(service.has(&own), "it may be published yet");
    assert!(!service.has(&other), "nobody has this token");

    let error = Outcome::Failed(support::job_error("DIVERGED", ""));
    service.end(&lease, error).await.expect("fails");
    service.collect(false, false).await;
    assert!(!service.has(&own));
}

#[tokio::test]
async fn a_removed_checkpoint_goes_while_its_training_runs() {
    let service = Service::start_with(at_once).await;
    let ada = service.ready_subject("Ada").await;
    let model = service.model_of(&ada).await;
    service.train(&model).await;
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("the training waits");
    let first = service
        .publish_with(&lease, 1, 20.0)
        .await
        .expect("publishes");
    let second = service
        .publish_with(&lease, 2, 30.0)
        .await
        .expect("publishes");
    let first = first.manifest.expect("has one").key;
    service.collect(false, false).await;
    assert!(!service.has(&first));
    // A late call whose objects were removed must not bring back the row.
    service
        .publish_with(&lease, 1, 20.0)
        .await
        .expect("is known");
    service.collect(false, false).await;
    assert!(!service.has(&first));
    let listed = service.checkpoints(&model.name).await;
    assert_eq!(listed.len(), 1);
    assert!(service.has(&second.manifest.expect("has one").key));
}

#[tokio::test]
async fn an_upload_is_kept_until_it_was_read() {
    let service = Service::start_with(at_once).await;
    let ada = service.subject("Ada").await;
    let uploaded = service.upload_good(&ada.name).await;
    let capture = uploaded.name;
    let upload = keys::upload_folder(id(&capture));
    service.collect(false, false).await;
    assert!(service.has(&upload));
    let worker = service.worker(&["ingest"]).await;
    let lease = service.lease(&worker).await.expect("the ingest job waits");
    service.collect(false, false).await;
    assert!(service.has(&upload));
    service.complete_ingest(&lease).await;
    service.collect(false, false).await;
    assert!(!service.has(&upload));
    let shard = keys::shard(id(&capture), id(&job_name(&lease)), lease.token);
    assert!(service.has(&shard));
}

#[tokio::test]
async fn an_upload_that_was_read_is_kept_for_a_while() {
    let service = Service::start_with(|config| {
        at_once(config);
        config.storage.keep_uploads = HOUR;
    })
    .await;
    let ada = service.ready_subject("Ada").await;
    let upload = keys::upload_folder(id(&ada.captures[0]));
    service.collect(false, true).await;
    assert!(service.has(&upload));
    let earlier = "UPDATE captures SET idle_since = idle_since - 3601";
    service.database.run(earlier).await;
    service.collect(false, false).await;
    assert!(!service.has(&upload));
}

#[tokio::test]
async fn the_remains_of_a_killed_writer_and_empty_folders_go() {
    let service = Service::start_with(at_once).await;
    let staged = "models/m/j-1/000000005/weights.safetensors#1";
    let path = service.path(staged);
    fs::create_dir_all(path.parent().expect("has one")).expect("makes folders");
    fs::write(&path, b"half").expect("writes");
    fs::create_dir_all(service.path("renders/j/2")).expect("makes folders");
    let foreign = service.path("backup/notes.txt");
    fs::create_dir_all(foreign.parent().expect("has one")).expect("makes folders");
    fs::write(&foreign, b"not ours").expect("writes");
    let found = service.collect(false, false).await;
    // The coordinator collects by itself once after its start, which may come first.
    assert!([(2, 4), (0, 0)].contains(&(found.count, found.bytes)));
    assert!(!service.has("models") && !service.has("renders"));
    assert!(
        foreign.exists(),
        "a folder of an unknown kind is not touched"
    );
}

#[tokio::test]
async fn a_deleted_render_is_gone_with_its_pictures() {
    let service = Service::start_with(at_once).await;
    let Trained {
        subject,
        model,
        worker,
        ..
    } = service.trained().await;
    let job = service.render(&model, &subject, "").await;
    let lease = service.lease(&worker).await.expect("the render waits");
    let key = service.complete_render(&lease).await;
    service.collect(false, false).await;
    assert!(service.has(&key));
    let name = job.name;
    let request = DeleteJobRequest {
        name,
        ..<_>::default()
    };
    service.jobs().delete_job(request).await.expect("deletes");
    service.collect(false, false).await;
    assert!(!service.has(&key));
}

#[tokio::test]
async fn a_disk_that_is_nearly_full_takes_no_uploads_and_trainings() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let model = service.model_of(&ada).await;
    let dir = service.stop().await;
    let service = Service::start_in(dir, |config| config.storage.min_free_bytes = u64::MAX).await;
    let before = service.stored_files().len();
    let upload = service
        .upload(&ada.name, vec![file("poses.json", b"{}")])
        .await;
    let message = upload
        .as_ref()
        .expect_err("is refused")
        .message()
        .to_owned();
    assert!(message.contains(&u64::MAX.to_string()), "{message}");
    assert_refused(upload, Code::ResourceExhausted, "DISK_FULL");
    let spec = TrainSpec {
        model: model.name.clone(),
        seconds: 1.0,
        ..<_>::default()
    };
    let request = CreateJobRequest {
        spec: Some(JobSpec {
            kind: Some(job_spec::Kind::Train(spec)),
        }),
        ..<_>::default()
    };
    let training = service.jobs().create_job(request).await;
    assert_refused(training, Code::ResourceExhausted, "DISK_FULL");
    assert_eq!(service.stored_files().len(), before);
    assert_eq!(service.get_subject(&ada.name).await.captures.len(), 1);
}

#[tokio::test]
async fn an_upload_that_would_fill_the_disk_is_refused_before_its_first_byte() {
    let dir = tempfile::TempDir::new().expect("a folder");
    let free = fs4::available_space(dir.path()).expect("has a disk");
    let large = 4 << 30;
    // Other programs use the same disk meanwhile.
    let min_free = free.saturating_sub(large / 2);
    let service = Service::start_in(dir, |config| config.storage.min_free_bytes = min_free).await;
    let ada = service.subject("Ada").await;
    let mut files = headers(&[file("poses.json", b"{}"), file("video.mp4", b"")]);
    files[1].bytes = large;
    let request = CreateUploadRequest {
        subject: ada.name.clone(),
        files,
        request_id: String::new(),
        validate_only: false,
    };
    let answer = service.uploads().create_upload(request).await;
    assert_refused(answer, Code::ResourceExhausted, "DISK_FULL");
    assert!(service.get_subject(&ada.name).await.captures.is_empty());
}

#[tokio::test]
async fn open_uploads_share_the_room_on_the_disk() {
    let dir = tempfile::TempDir::new().expect("a folder");
    let free = fs4::available_space(dir.path()).expect("has a disk");
    let large = 2 << 30;
    // One fits, with room for other programs that use the same disk meanwhile.
    let min_free = free.saturating_sub(large + large / 2);
    let service = Service::start_in(dir, |config| config.storage.min_free_bytes = min_free).await;
    let ada = service.subject("Ada").await;
    let open = async || {
        let mut files = headers(&[file("poses.json", b"{}"), file("video.mp4", b"")]);
        files[1].bytes = large;
        let request = CreateUploadRequest {
            subject: ada.name.clone(),
            files,
            ..CreateUploadRequest::default()
        };
        service.uploads().create_upload(request).await
    };
    open().await.expect("fits");
    assert_refused(open().await, Code::ResourceExhausted, "DISK_FULL");
}

#[tokio::test]
async fn an_upload_ends_after_its_idle_time_and_frees_its_request_id() {
    let clock = Arc::new(ManualClock::at(1e9));
    let own = clock.clone();
    let service = Service::start_with(|config| {
        at_once(config);
        config.clock = own;
        config.upload.expiry = HOUR;
    })
    .await;
    let ada = service.subject("Ada").await;
    let files = [file("poses.json", b"{}")];
    let open = async || {
        let request = CreateUploadRequest {
            subject: ada.name.clone(),
            files: headers(&files),
            request_id: "the files".into(),
            validate_only: false,
        };
        let opened = service.uploads().create_upload(request).await;
        opened.expect("is opened").into_inner()
    };
    let upload = open().await;
    let half = chunks(&upload.name, &[file("poses.json", b"{")]);
    service.write(half).await.expect("writes");
    let key = keys::upload_folder(id(&upload.name));
    clock.advance(0.9 * HOUR.as_secs_f64());
    service.collect(false, false).await;
    assert!(service.has(&key), "it may go on");
    clock.advance(0.2 * HOUR.as_secs_f64());
    service.collect(true, false).await;
    assert!(service.has(&key), "nothing was to change");
    service.collect(false, false).await;
    assert!(!service.has(&key), "it was idle for too long");
    assert!(!service.has("uploads"));
    assert!(service.get_subject(&ada.name).await.captures.is_empty());
    let late = chunks(&upload.name, &files);
    assert_refused(service.write(late).await, Code::NotFound, "NOT_FOUND");
    let finished = service.finish(&upload.name).await;
    assert_refused(finished, Code::NotFound, "NOT_FOUND");
    assert_ne!(open().await.name, upload.name, "the same files once more");
}

#[tokio::test]
async fn an_upload_that_is_written_does_not_end() {
    let service = Service::start_with(at_once).await;
    let ada = service.subject("Ada").await;
    let files = [file("poses.json", b"{}")];
    let upload = service.open_upload(&ada.name, &files).await;
    let upload = upload.expect("is opened").name;
    let half = chunks(&upload, &[file("poses.json", b"{")]);
    service.write(half).await.expect("writes");
    service.collect(false, true).await;
    let rest = vec![support::chunk(&upload, "poses.json", 1, b"}")];
    service.write(rest).await.expect("writes");
    service.finish(&upload).await.expect("is complete");
}

#[tokio::test]
async fn parts_that_no_row_names_go_while_their_upload_is_in_use() {
    let service = Service::start_with(at_once).await;
    let ada = service.subject("Ada").await;
    let files = [file("poses.json", b"{}")];
    let upload = service.open_upload(&ada.name, &files).await;
    let upload = upload.expect("is opened").name;
    let half = chunks(&upload, &[file("poses.json", b"{")]);
    service.write(half).await.expect("writes");
    // The first writer was lost between its second object and the row of it; another coordinator's writer is not the newest
    // yet.
    let part = |writer, number| keys::upload_part(id(&upload), writer, number);
    for key in [part(0, 0), part(1, 1), part(7, 0)] {
        service.put(&key, b"lost").await;
    }
    service.collect(false, false).await;
    assert!(!service.has(&part(0, 0)), "no such writer commits any more");
    assert!(service.has(&part(1, 0)), "a row names it");
    assert!(service.has(&part(1, 1)), "it may be recorded yet");
    service.get_upload(&upload).await.expect("is taken over");
    service.collect(true, false).await;
    assert!(service.has(&part(1, 1)), "nothing was to change");
    service.collect(false, false).await;
    assert!(!service.has(&part(1, 1)) && service.has(&part(1, 0)));
    assert!(service.has(&part(7, 0)), "its writer is to come");
    let rest = vec![support::chunk(&upload, "poses.json", 1, b"}")];
    service.write(rest).await.expect("writes");
    service.finish(&upload).await.expect("is complete");
}
