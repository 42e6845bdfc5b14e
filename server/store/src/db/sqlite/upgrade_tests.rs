//! Databases of earlier schemas, opened by this program.

use super::Sqlite;
use super::migrations::migrations;
use crate::Tenant;
use crate::rules::retention::Retention;
use crate::stage::running_job_goes_on;
use crate::{JobKind, NewJob, NewPart, NewPiece, NewWorker, PartId, RequestKey, Store, Upload};
use sqlx::sqlite::{SqliteConnectOptions, SqlitePoolOptions};
use sqlx::{Executor, Row};
use std::path::Path;
use std::sync::Arc;
use yoto_process::clock::{ManualClock, SystemClock};
use yoto_proto::orders::LEVEL;
use yoto_proto::v1::{EvaluateSpec, JobSpec, ObjectRef, WorkerDevice, job, job_spec};

/// The store's database.
fn sqlite(store: &Store) -> &Sqlite {
    store.db.sqlite()
}

/// A model with a checkpoint, trained by a job that ended, and a job that waits; a rejected capture, and
/// an upload that broke off.
const CONTENT: &str = "
    INSERT INTO models (id, display_name, tier, variant) VALUES ('m', 'm', 'draft', 'yoto');
    INSERT INTO workers (id, display_name, backend, adapter, gpu, memory_bytes)
        VALUES ('w', 'w', 'cpu', 'cpu', 0, 0);
    INSERT INTO worker_kinds VALUES ('w', 'train'), ('w', 'render');
    INSERT INTO jobs (ord, id, kind, model, state, spec, lease, worker, end_time)
        VALUES (7, 'trained', 'train', 'm', 'SUCCEEDED', x'', 3, 'w', 1.5);
    INSERT INTO jobs (ord, id, kind, model, spec) VALUES (9, 'waits', 'train', 'm', x'');
    INSERT INTO jobs (ord, id, kind, model, spec) VALUES (10, 'looks', 'render', 'm', x'');
    INSERT INTO checkpoints
        (model, step, job, manifest_key, manifest_bytes, manifest_sha256, bytes)
        VALUES ('m', 40, 'trained', 'k', 1, 's', 1);
    INSERT INTO subjects (id, display_name, consent_note) VALUES ('s', 's', '');
    INSERT INTO captures (id, subject, state) VALUES ('c', 's', 'REJECTED'), ('u', 's', 'UPLOADING');
    INSERT INTO capture_files (capture, path, bytes, sha256) VALUES ('c', 'poses.json', 2, 'x');
    INSERT INTO jobs (ord, id, kind, capture, state, spec, end_time)
        VALUES (8, 'read', 'ingest', 'c', 'FAILED', x'', 1.5);
";

#[tokio::test]
async fn the_first_schema_learns_evaluations_and_keeps_its_rows() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("yoto.db");
    write_schema(&path, 1, CONTENT.to_owned()).await;

    let store = Store::open_sqlite(&path, Arc::new(SystemClock))
        .await
        .expect("upgrades");
    let trained = store
        .job(&Tenant::default(), "trained")
        .await
        .expect("is kept");
    assert_eq!(trained.state(), job::State::Succeeded);
    assert_eq!(trained.worker, "workers/w");
    let checkpoints = store
        .checkpoints(&Tenant::default(), "m", 9)
        .await
        .expect("are kept");
    assert_eq!(checkpoints.len(), 1);
    assert_eq!(checkpoints[0].tradeoff, None, "it was never measured");
    let none = Retention {
        newest: 1,
        every: 0,
    };
    let kept = store
        .kept_checkpoints(&Tenant::default(), "m", none)
        .await
        .expect("are kept");
    // The render does not say which checkpoint it uses.
    assert_eq!(kept[0].kept_for, ["newest", "best", "jobs/looks"]);
    let row = sqlx::query(
        "SELECT m.published, c.number, j.last_token
         FROM models m JOIN checkpoints c JOIN jobs j WHERE j.id = 'trained'",
    )
    .fetch_one(&sqlite(&store).readers)
    .await
    .expect("counts");
    let counted: [i64; 3] = ["published", "number", "last_token"].map(|it| row.get(it));
    assert_eq!(counted, [1, 1, 3]);
    let spec = JobSpec {
        kind: Some(job_spec::Kind::Evaluate(EvaluateSpec {
            model: "models/m".into(),
            ..EvaluateSpec::default()
        })),
    };
    let evaluation = store
        .create_job(&Tenant::default(), NewJob::normal(spec), None)
        .await
        .expect("is queued");
    assert_eq!(evaluation.queue_position, 2, "behind the jobs that wait");
    let new = NewWorker {
        key: None,
        embedded: None,
        display_name: "new".into(),
        device: WorkerDevice::default(),
        kinds: vec![JobKind::Evaluate],
        version: String::new(),
        order_level: 1,
        reads_films: false,
    };
    let worker = store
        .register_worker(&Tenant::default(), new)
        .await
        .expect("registers");
    let outcome = store
        .lease_job(&Tenant::default(), &worker, "", false, 60.0)
        .await
        .expect("answers");
    let leased = outcome.leased;
    assert_eq!(leased.map(|it| it.job.name), Some(evaluation.name));
    // References to the recreated tables are still enforced.
    let error = sqlite(&store)
        .writer
        .execute("DELETE FROM workers WHERE id = 'w'")
        .await
        .expect_err("a job refers to it");
    assert!(error.to_string().contains("FOREIGN KEY"), "{error}");
    sqlite(&store)
        .writer
        .execute("DELETE FROM jobs WHERE id = 'trained'")
        .await
        .expect("a checkpoint outlives its job");
    assert_eq!(
        store
            .checkpoints(&Tenant::default(), "m", 9)
            .await
            .expect("is kept")
            .len(),
        1
    );
    exports_are_learned(&store).await;
    captures_are_kept(&store).await;
    store.close().await;

    Store::open_sqlite(&path, Arc::new(SystemClock))
        .await
        .expect("opens again");
}

/// The schema before tenants, and what a service has while a worker trains: a RUNNING job with a checkpoint, its lease and
/// its pins, a pause, and a request id.
const RUNNING: &str = "
    INSERT INTO subjects (id, display_name, consent_note) VALUES ('s', 'Ada', '');
    INSERT INTO captures (id, subject, state, shard_key, shard_bytes, shard_sha256)
        VALUES ('c', 's', 'READY', 'k', 1, 'x');
    INSERT INTO models (id, display_name, tier, variant) VALUES ('m', 'm', 'draft', 'yoto');
    INSERT INTO slots (model, slot, subject) VALUES ('m', 0, 's');
    INSERT INTO workers (id, display_name, backend, adapter, gpu, memory_bytes) VALUES ('w', 'w', 'cpu', 'cpu', 0, 0);
    INSERT INTO worker_kinds VALUES ('w', 'train'), ('w', 'render');
    INSERT INTO jobs (id, kind, model, state, spec, lease, last_token, worker, lease_deadline, lease_request)
        VALUES ('j', 'train', 'm', 'RUNNING', x'120A0A086D6F64656C732F6D', 77, 77, 'w', 1e10, 'r');
    INSERT INTO job_attempts (job, lease, worker, begin_time) VALUES ('j', 77, 'w', 1.5);
    INSERT INTO job_captures (job, subject, capture) VALUES ('j', 's', 'c');
    INSERT INTO lease_clock (id, last_tick) VALUES (1, 1.5);
    INSERT INTO paused_kinds VALUES ('render', 'later', 1.5);
    INSERT INTO request_ids (method, request_id, body_sha256, answer) VALUES ('CreateModel', 'q', 'b', 'm');
";

#[tokio::test]
async fn a_running_job_goes_on_after_the_upgrade_to_tenants() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("yoto.db");
    write_schema(&path, 14, RUNNING.to_owned()).await;
    let clock = Arc::new(ManualClock::at(2.0));
    let store = Store::open_sqlite(&path, clock).await.expect("upgrades");
    let own = Tenant::default();
    running_job_goes_on(&store, 1).await;
    let new = NewWorker {
        key: None,
        embedded: None,
        display_name: "new".into(),
        device: WorkerDevice::default(),
        kinds: vec![JobKind::Train],
        version: String::new(),
        order_level: 1,
        reads_films: false,
    };
    let worker = store.register_worker(&own, new).await.expect("registers");
    let again = store.lease_job(&own, &worker, "", false, 20.0).await;
    let again = again.expect("answers").leased.expect("the job waits");
    assert_eq!(again.job.name, "jobs/j");
    assert!(again.token > 77);

    let paused = store.paused_kinds(&own).await.expect("lists");
    assert_eq!(paused[0].reason, "later");
    let request = RequestKey {
        method: "CreateModel",
        request_id: "q".into(),
        body_sha256: "b".into(),
    };
    let answered = store.answered(&own, Some(&request)).await.expect("reads");
    assert_eq!(answered.as_deref(), Some("m"));
    let other = Tenant::new("other").expect("an id");
    assert_eq!(
        store.answered(&other, Some(&request)).await.expect("reads"),
        None
    );
    store
        .job(&other, "j")
        .await
        .expect_err("is the default tenant's");
    // A statement that forgets the tenant makes a row of nobody.
    let forgotten =
        "INSERT INTO models (id, display_name, tier, variant) VALUES ('n', 'n', 'draft', 'yoto')";
    sqlite(&store)
        .writer
        .execute(forgotten)
        .await
        .expect("writes");
    store.model(&own, "n").await.expect_err("is nobody's");
}

/// Uploads before their bytes were in parts: one that is open, one whose ingest job waits, one that was read, and one whose
/// files were removed.
const UPLOADS: &str = "
    INSERT INTO subjects (id, display_name, consent_note, tenant) VALUES ('s', 'Ada', '', 'default');
    INSERT INTO captures (id, subject, state, writer, files_removed)
        VALUES ('open', 's', 'UPLOADING', 3, 0), ('read', 's', 'INGESTING', 5, 0), ('gone', 's', 'REJECTED', 1, 1);
    INSERT INTO captures (id, subject, state, shard_key, shard_bytes, shard_sha256)
        VALUES ('done', 's', 'READY', 'k', 1, 'x');
    INSERT INTO capture_files (capture, path, bytes, sha256, committed)
        VALUES ('open', 'poses.json', 2, 'p', 2), ('open', 'video.mp4', 10, 'v', 4), ('open', 'z', 5, 'z', 0),
               ('read', 'poses.json', 2, 'x', 2), ('done', 'poses.json', 2, 'x', 2), ('gone', 'poses.json', 2, 'x', 2);
    INSERT INTO jobs (id, kind, capture, spec, tenant)
        VALUES ('j', 'ingest', 'read', x'0A0F0A0D63617074757265732F72656164', 'default');
";

#[tokio::test]
async fn uploads_of_an_earlier_version_are_parts() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("yoto.db");
    write_schema(&path, 22, UPLOADS.to_owned()).await;
    let store = Store::open_sqlite(&path, Arc::new(ManualClock::at(2.0))).await;
    let (store, own) = (store.expect("upgrades"), Tenant::default());
    let committed = |upload: &Upload| upload.files.iter().map(|it| it.committed).sum::<u64>();
    let open = store.upload(&own, "open").await.expect("is kept");
    assert_eq!((committed(&open), open.pieces), (6, 2));
    let newest = open.newest.expect("has parts");
    assert_eq!(newest.id.writer, 0);
    assert_eq!(newest.object.key, "uploads/open/video.mp4");
    assert_eq!((newest.object.bytes, &*newest.object.sha256), (4, ""));
    for other in ["done", "gone"] {
        let parts = store.upload_parts(&own, other).await.expect("is kept");
        assert!(parts.is_empty(), "nobody reads {other}");
    }

    // It goes on where it was.
    let writer = store.take_over_upload(&own, "open").await;
    let writer = writer.expect("is open");
    assert_eq!(writer, 4);
    let piece = |path: &str, from, to| NewPiece {
        path: path.into(),
        from,
        to,
    };
    let part = NewPart {
        id: PartId { writer, number: 0 },
        object: ObjectRef {
            key: "new".into(),
            bytes: 15,
            sha256: "n".into(),
        },
        pieces: vec![piece("video.mp4", 4, 10), piece("z", 0, 5)],
        replaces: Some(newest.id),
    };
    let done = store.commit_part(&own, "open", &part).await;
    done.expect("follows what was committed");
    let finished = store.finish_upload(&own, "open", writer, None).await;
    let finished = finished.expect("is complete");

    // A worker of the earlier version reads what that version has stored, and nothing else.
    let worker = |order_level| NewWorker {
        key: None,
        embedded: None,
        display_name: "old".into(),
        device: WorkerDevice::default(),
        kinds: vec![JobKind::Ingest],
        version: String::new(),
        order_level,
        reads_films: false,
    };
    let lease = async |order_level| {
        let id = store.register_worker(&own, worker(order_level)).await;
        let id = id.expect("registers");
        let leased = store.lease_job(&own, &id, "", false, 20.0).await;
        leased.expect("answers").leased
    };
    let old = lease(1).await.expect("the old job waits");
    assert_eq!(old.job.name, "jobs/j");
    assert_eq!(old.inputs.parts, []);
    let object = old.inputs.files[0].object.clone().expect("is one object");
    assert_eq!(
        (&*object.key, &*object.sha256),
        ("uploads/read/poses.json", "x")
    );
    assert!(lease(1).await.is_none(), "the new job is none for it");
    let new = lease(LEVEL).await.expect("the new job waits");
    assert_eq!(new.job.name, finished.ingest_job);
    assert_eq!(new.inputs.parts, [part.object]);
    let files = &new.inputs.files;
    let object = files[0].object.clone().expect("is one object");
    assert_eq!(object.key, "uploads/open/poses.json");
    let pieces: Vec<_> = files[1..].iter().flat_map(|it| &it.pieces).collect();
    let pieces: Vec<_> = pieces.iter().map(|it| (it.start, it.bytes)).collect();
    assert_eq!(pieces, [(0, 10), (10, 5)]);
}

/// Makes a database with the schema of `version` and some content.
pub async fn write_schema(path: &Path, version: i64, content: String) {
    let options = SqliteConnectOptions::new()
        .filename(path)
        .foreign_keys(true)
        .create_if_missing(true);
    let pool = SqlitePoolOptions::new()
        .max_connections(1)
        .connect_with(options)
        .await
        .expect("opens");
    let schema = migrations();
    schema.run_to(version, &pool).await.expect("the old schema");
    pool.execute(sqlx::AssertSqlSafe(content))
        .await
        .expect("writes");
    pool.close().await;
}

/// Jobs and workers may be of the newest kind, and of no other.
async fn exports_are_learned(store: &Store) {
    let kinds = "INSERT INTO worker_kinds VALUES ('w', 'export')";
    sqlite(store)
        .writer
        .execute(kinds)
        .await
        .expect("is a kind");
    let of_kind = |kind: &str| {
        format!("INSERT INTO jobs (id, kind, model, spec) VALUES ('{kind}', '{kind}', 'm', x'')")
    };
    let insert = |kind: &str| {
        let statement = sqlx::AssertSqlSafe(of_kind(kind));
        async move { sqlite(store).writer.execute(statement).await }
    };
    insert("export").await.expect("is a kind");
    let error = insert("sing").await.expect_err("not a kind of job");
    assert!(error.to_string().contains("CHECK"), "{error}");
}

/// A capture has its files and its job, and can be read again; an upload that broke off stays open.
async fn captures_are_kept(store: &Store) {
    let uploaded = store
        .upload(&Tenant::default(), "c")
        .await
        .expect("is kept");
    let file = &uploaded.files[0];
    assert!(!uploaded.open && file.committed == file.bytes);
    assert!(
        store
            .upload(&Tenant::default(), "u")
            .await
            .expect("is kept")
            .open
    );
    let subject = store
        .subject(&Tenant::default(), "s")
        .await
        .expect("is kept");
    assert_eq!(subject.captures, ["captures/c", "captures/u"]);
    let rejected = store
        .capture(&Tenant::default(), "c")
        .await
        .expect("is kept");
    assert_eq!(rejected.ingest_job, "jobs/read");
    let again = store
        .ingest_capture(&Tenant::default(), "c", None)
        .await
        .expect("is queued");
    assert_ne!(again.ingest_job, rejected.ingest_job);
    let ended = store.expire_uploads(0.0).await.expect("ends");
    assert_eq!(ended, ["u"]);
    let error = sqlite(store)
        .writer
        .execute("DELETE FROM captures WHERE id = 'c'")
        .await
        .expect_err("a job refers to it");
    assert!(error.to_string().contains("FOREIGN KEY"), "{error}");
}
