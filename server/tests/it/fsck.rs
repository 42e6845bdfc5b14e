//! The check of all objects, beside a running service and without one.

use crate::support::{Database, Service, claim, file, id, job_name};
use std::fs;
use std::path::Path;
use tempfile::TempDir;
use tokio::runtime::Handle;
use tokio::task::block_in_place;
use yoto_proto::manifest::files;
use yoto_proto::v1::{Checkpoint, DeleteJobRequest};
use yoto_proto::worker::v1::{Lease, PublishCheckpointRequest};
use yoto_proto::{keys, names};
use yoto_server::Environment;
use yoto_server::fsck::{FsckError, ObjectFault, Place, Report, fsck};

/// Where a running service has its state.
fn place(service: &Service) -> Place {
    Place {
        data_dir: service.dir.path().to_owned(),
        database: service.database.url(),
        objects: Some(service.coordinator.objects_url().clone()),
        environment: Environment::of_process(),
    }
}

/// What the check of a running service finds.
async fn check(service: &Service) -> Report {
    let place = place(service);
    fsck(&place, |_| {}).await.expect("can be read")
}

/// Keys and resources of faults.
fn told(faults: &[ObjectFault]) -> Vec<(&str, &str)> {
    let told = faults.iter().map(|it| (it.key.as_str(), it.of.as_str()));
    told.collect()
}

fn orphans(report: &Report) -> Vec<&str> {
    report.orphans.iter().map(|it| it.key.as_str()).collect()
}

/// A service with objects of every kind of row: a shard, parts of an upload, checkpoints, pictures.
struct Whole {
    shard: String,
    capture: String,
    checkpoint: Checkpoint,
    weights: String,
    training: Lease,
    picture: String,
    render: String,
}

impl Whole {
    async fn of(service: &Service) -> Self {
        let ada = service.ready_subject("Ada").await;
        let capture = ada.captures[0].clone();
        let shards = service.path(&format!("captures/{}", id(&capture)));
        let lease = fs::read_dir(shards).expect("lists").next().expect("one");
        let lease = lease.expect("an entry").file_name();
        let shard = format!("captures/{}/{}/shard.bin", id(&capture), lease.display());
        let model = service.model_of(&ada).await;
        let worker = service.worker(&["train", "render"]).await;
        service.train(&model).await;
        let training = service.lease(&worker).await.expect("the training waits");
        let (checkpoint, weights) = publish(service, &training).await;
        let render = service.render(&model, &ada, "").await.name;
        let painter = service.worker(&["render"]).await;
        let lease = service.lease(&painter).await.expect("the render waits");
        let picture = service.complete_render(&lease).await;
        Self {
            shard,
            capture,
            checkpoint,
            weights,
            training,
            picture,
            render,
        }
    }

    fn manifest(&self) -> String {
        self.checkpoint.manifest.clone().expect("has one").key
    }
}

/// Publishes a checkpoint with a manifest that names its weights; their key.
async fn publish(service: &Service, lease: &Lease) -> (Checkpoint, String) {
    let model = lease.inputs.clone().and_then(|it| it.model);
    let model = model.expect("has a model").name;
    let (job, step) = (job_name(lease), 5);
    let folder = keys::checkpoint(id(&model), id(&job), lease.token, step);
    let key = format!("{folder}/{}", files::WEIGHTS);
    let weights = service.put(&key, b"weights").await;
    let objects = vec![(files::WEIGHTS, weights)];
    let manifest = service.manifest_of(&folder, step, objects).await;
    let checkpoint = Checkpoint {
        name: names::checkpoint(&model, step),
        step,
        manifest: Some(manifest),
        bytes: 7,
        ..Checkpoint::default()
    };
    let request = PublishCheckpointRequest {
        claim: Some(claim(lease)),
        checkpoint: Some(checkpoint.clone()),
        save_seconds: 0.5,
    };
    let published = service.workers().publish_checkpoint(request).await;
    published.expect("holds the lease");
    (checkpoint, key)
}

#[tokio::test]
async fn a_sound_service_has_no_faults_while_it_works() {
    let service = Service::start().await;
    let whole = Whole::of(&service).await;
    let ada = service.subject("Bob").await;
    let files = [file("poses.json", b"{}"), file("a", b"frame")];
    let upload = service.open_upload(&ada.name, &files).await;
    let upload = upload.expect("opens").name;
    // What may get a row yet: of a running job, and of an upload before its first commit.
    let coming = keys::checkpoint(
        id(&whole.checkpoint.name.replace("/checkpoints/5", "")),
        id(&job_name(&whole.training)),
        whole.training.token,
        6,
    );
    service.put(&format!("{coming}/weights"), b"w").await;
    let part = keys::upload_part(id(&upload).trim_start_matches("uploads/"), 0, 1);
    service.put(&part, b"bytes").await;

    let report = check(&service).await;
    assert!(report.is_sound(), "{report:?}");
    assert_eq!(orphans(&report), [""; 0]);
    let stored = service.stored_files().len() as u64;
    assert_eq!(report.objects + 2, stored, "all but what is coming");

    let dir = service.stop().await;
    let service = Service::start_in(dir, |_| {}).await;
    assert!(check(&service).await.is_sound());
}

#[tokio::test]
async fn faults_are_told_with_what_names_the_object() {
    let service = Service::start().await;
    let whole = Whole::of(&service).await;
    fs::remove_file(service.path(&whole.shard)).expect("removes");
    fs::write(service.path(&whole.weights), b"wEights").expect("writes");
    fs::write(service.path(&whole.picture), b"pict").expect("writes");
    let stray = "renders/somebody/3/000000.png";
    service.put(stray, b"stray").await;

    let report = check(&service).await;
    assert!(!report.is_sound());
    assert_eq!(
        told(&report.missing),
        [(whole.shard.as_str(), whole.capture.as_str())]
    );
    let damaged = [
        (whole.picture.as_str(), whole.render.as_str()),
        (whole.weights.as_str(), whole.checkpoint.name.as_str()),
    ];
    assert_eq!(told(&report.damaged), damaged);
    let what = |at: usize| report.damaged[at].what.as_str();
    assert_eq!(what(0), "it has 4 bytes, not 7");
    assert_eq!(what(1), "its bytes are not those of its checksum");
    assert_eq!(orphans(&report), [stray]);
}

#[tokio::test]
async fn an_unreadable_manifest_does_not_make_its_objects_orphans() {
    let service = Service::start().await;
    let whole = Whole::of(&service).await;
    let manifest = whole.manifest();
    fs::remove_file(service.path(&manifest)).expect("removes");
    let report = check(&service).await;
    assert_eq!(
        told(&report.missing),
        [(manifest.as_str(), whole.checkpoint.name.as_str())]
    );
    assert_eq!(orphans(&report), [""; 0]);

    // One with the right checksum that is no manifest.
    let published = service.publish(&whole.training, 6).await;
    let key = published.expect("publishes").manifest.expect("has one").key;
    let torn = service.put(&key, b"{}").await;
    let row = format!(
        "UPDATE checkpoints SET manifest_bytes = {}, manifest_sha256 = '{}' WHERE manifest_key = '{key}'",
        torn.bytes, torn.sha256
    );
    service.database.run(&row).await;
    let report = check(&service).await;
    let what = &report.damaged[0].what;
    assert!(what.starts_with("it is no manifest"), "{what}");
}

#[tokio::test]
async fn only_a_service_of_this_version_is_checked_with_its_own_objects() {
    let dir = TempDir::new().expect("a folder");
    let place = |data_dir: &Path, database: &Database, objects| Place {
        data_dir: data_dir.to_owned(),
        database: database.url(),
        objects,
        environment: Environment::of_process(),
    };
    // Nothing has run on it.
    let database = Database::of(dir.path());
    let none = fsck(&place(dir.path(), &database, None), |_| {}).await;
    let none = none.expect_err("there is nothing");
    match database.url() {
        None => assert!(matches!(none, FsckError::NoService(_)), "{none}"),
        Some(_) => assert!(none.to_string().contains("is empty or of"), "{none}"),
    }
    let service = Service::start().await;
    let other = TempDir::new().expect("a folder");
    let elsewhere = url::Url::from_directory_path(other.path()).expect("a URL");
    let theirs = place(service.dir.path(), &service.database, Some(elsewhere));
    let theirs = fsck(&theirs, |_| {}).await.expect_err("of nobody");
    assert!(theirs.to_string().contains("yoto-store"), "{theirs}");
}

#[tokio::test(flavor = "multi_thread")]
async fn what_the_service_deletes_meanwhile_is_not_missing() {
    let service = Service::start().await;
    let whole = Whole::of(&service).await;
    fs::remove_file(service.path(&whole.picture)).expect("removes");
    let report = check(&service).await;
    assert_eq!(told(&report.missing).len(), 1, "{report:?}");
    // The row goes after the check has read it.
    let mut request = Some(DeleteJobRequest {
        name: whole.render.clone(),
        ..DeleteJobRequest::default()
    });
    let delete = |_| {
        let Some(request) = request.take() else {
            return;
        };
        let mut jobs = service.jobs();
        let deleted = jobs.delete_job(request);
        let deleted = block_in_place(|| Handle::current().block_on(deleted));
        deleted.expect("has ended");
    };
    let report = fsck(&place(&service), delete).await.expect("can be read");
    assert!(report.missing.is_empty(), "{report:?}");
}
