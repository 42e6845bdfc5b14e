//! Databases of earlier schemas, opened by this program.

use super::SqliteStore;
use super::migrations::migrations;
use crate::checkpoints::retention::Retention;
use crate::clock::SystemClock;
use crate::store::{JobKind, NewJob, NewWorker, Store};
use sqlx::sqlite::{SqliteConnectOptions, SqlitePoolOptions};
use sqlx::{Executor, Row};
use std::sync::Arc;
use yoto_proto::v1::{EvaluateSpec, JobSpec, WorkerDevice, job, job_spec};

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
    let options = SqliteConnectOptions::new()
        .filename(&path)
        .foreign_keys(true)
        .create_if_missing(true);
    let pool = SqlitePoolOptions::new()
        .max_connections(1)
        .connect_with(options)
        .await
        .expect("opens");
    migrations().run_to(1, &pool).await.expect("the old schema");
    pool.execute(CONTENT).await.expect("writes");
    pool.close().await;

    let store = SqliteStore::open(&path, Arc::new(SystemClock))
        .await
        .expect("upgrades");
    let trained = store.job("trained").await.expect("is kept");
    assert_eq!(trained.state(), job::State::Succeeded);
    assert_eq!(trained.worker, "workers/w");
    let checkpoints = store.checkpoints("m", 9).await.expect("are kept");
    assert_eq!(checkpoints.len(), 1);
    assert_eq!(checkpoints[0].tradeoff, None, "it was never measured");
    let none = Retention {
        newest: 1,
        every: 0,
    };
    let kept = store.kept_checkpoints("m", none).await.expect("are kept");
    // The render does not say which checkpoint it uses.
    assert_eq!(kept[0].kept_for, ["newest", "best", "jobs/looks"]);
    let row = sqlx::query(
        "SELECT m.published, c.number, j.last_token
         FROM models m JOIN checkpoints c JOIN jobs j WHERE j.id = 'trained'",
    )
    .fetch_one(&store.readers)
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
        .create_job(NewJob::normal(spec), None)
        .await
        .expect("is queued");
    assert_eq!(evaluation.queue_position, 2, "behind the jobs that wait");
    let new = NewWorker {
        embedded: false,
        display_name: "new".into(),
        device: WorkerDevice::default(),
        kinds: vec![JobKind::Evaluate],
        version: String::new(),
        order_level: 1,
    };
    let worker = store.register_worker(new).await.expect("registers");
    let outcome = store
        .lease_job(&worker, "", false, 60.0)
        .await
        .expect("answers");
    let leased = outcome.leased;
    assert_eq!(leased.map(|it| it.job.name), Some(evaluation.name));
    // References to the recreated tables are still enforced.
    let error = store
        .writer
        .execute("DELETE FROM workers WHERE id = 'w'")
        .await
        .expect_err("a job refers to it");
    assert!(error.to_string().contains("FOREIGN KEY"), "{error}");
    store
        .writer
        .execute("DELETE FROM jobs WHERE id = 'trained'")
        .await
        .expect("a checkpoint outlives its job");
    assert_eq!(store.checkpoints("m", 9).await.expect("is kept").len(), 1);
    exports_are_learned(&store).await;
    captures_are_kept(&store).await;
    store.close().await;

    SqliteStore::open(&path, Arc::new(SystemClock))
        .await
        .expect("opens again");
}

/// Jobs and workers may be of the newest kind, and of no other.
async fn exports_are_learned(store: &SqliteStore) {
    let kinds = "INSERT INTO worker_kinds VALUES ('w', 'export')";
    store.writer.execute(kinds).await.expect("is a kind");
    let of_kind = |kind: &str| {
        format!("INSERT INTO jobs (id, kind, model, spec) VALUES ('{kind}', '{kind}', 'm', x'')")
    };
    let insert = |kind: &str| {
        let statement = sqlx::AssertSqlSafe(of_kind(kind));
        async move { store.writer.execute(statement).await }
    };
    insert("export").await.expect("is a kind");
    let error = insert("sing").await.expect_err("not a kind of job");
    assert!(error.to_string().contains("CHECK"), "{error}");
}

/// A capture has its files and its job, and can be read again; an upload that broke off stays open.
async fn captures_are_kept(store: &SqliteStore) {
    let uploaded = store.upload("c").await.expect("is kept");
    let file = &uploaded.files[0];
    assert!(!uploaded.open && file.committed == file.bytes);
    assert!(store.upload("u").await.expect("is kept").open);
    let subject = store.subject("s").await.expect("is kept");
    assert_eq!(subject.captures, ["captures/c", "captures/u"]);
    let rejected = store.capture("c").await.expect("is kept");
    assert_eq!(rejected.ingest_job, "jobs/read");
    let again = store.ingest_capture("c", None).await.expect("is queued");
    assert_ne!(again.ingest_job, rejected.ingest_job);
    let ended = store.expire_uploads(0.0).await.expect("ends");
    assert_eq!(ended, ["u"]);
    let error = store
        .writer
        .execute("DELETE FROM captures WHERE id = 'c'")
        .await
        .expect_err("a job refers to it");
    assert!(error.to_string().contains("FOREIGN KEY"), "{error}");
}
