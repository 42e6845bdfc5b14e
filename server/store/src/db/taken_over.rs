//! What holds of the databases in `tests/data` once this program has taken them over, for both kinds of database.

use crate::rules::retention::Retention;
use crate::stage::running_job_goes_on;
use crate::{
    JobKind, LeasedJob, NewJob, NewPart, NewPiece, NewWorker, PartId, RequestKey, Store, Tenant,
    Upload,
};
use yoto_proto::orders::LEVEL;
use yoto_proto::v1::{EvaluateSpec, JobSpec, ObjectRef, WorkerDevice, job_spec};

/// The time of their coordinator, just after that of their rows.
pub(crate) const NOW: f64 = 2.0;

fn worker(kind: JobKind, order_level: u32) -> NewWorker {
    NewWorker {
        key: None,
        embedded: None,
        display_name: "new".into(),
        device: WorkerDevice::default(),
        kinds: vec![kind],
        version: String::new(),
        order_level,
        reads_films: false,
    }
}

/// The job that a new worker of a level gets.
async fn leased(store: &Store, kind: JobKind, order_level: u32) -> Option<LeasedJob> {
    let own = Tenant::default();
    let id = store.register_worker(&own, worker(kind, order_level)).await;
    let id = id.expect("registers");
    let outcome = store.lease_job(&own, &id, "", false, 20.0).await;
    outcome.expect("answers").leased
}

/// The running job goes on and is leased again; orders, pauses and request ids are those of before.
pub(crate) async fn jobs_go_on(store: &Store) {
    let own = Tenant::default();
    running_job_goes_on(store).await;
    assert!(
        leased(store, JobKind::Train, LEVEL).await.is_none(),
        "the service is drained"
    );
    store.end_drain().await.expect("ends");
    let none = store.lease_job(&own, "w", "", false, 20.0).await;
    let none = none.expect("answers").leased;
    assert_eq!(
        none.map(|it| it.job.name),
        None,
        "a worker from before there were levels understands no orders"
    );
    let again = leased(store, JobKind::Train, LEVEL).await;
    let again = again.expect("the job waits");
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
    let answered = store.answered(&other, Some(&request)).await.expect("reads");
    assert_eq!(answered, None);
    let job = store.job(&other, "j").await;
    job.expect_err("is the default tenant's");
    let spec = JobSpec {
        kind: Some(job_spec::Kind::Evaluate(EvaluateSpec {
            model: "models/m".into(),
            ..EvaluateSpec::default()
        })),
    };
    let evaluation = store.create_job(&own, NewJob::normal(spec), None).await;
    let evaluation = evaluation.expect("is queued");
    let next = leased(store, JobKind::Evaluate, LEVEL).await;
    assert_eq!(next.map(|it| it.job.name), Some(evaluation.name));
}

/// A render `looks` of an early version, which does not say which checkpoint it uses, keeps all of its model.
pub(crate) async fn a_render_without_a_checkpoint_keeps_it(store: &Store) {
    let none = Retention {
        newest: 1,
        every: 0,
    };
    let kept = store.kept_checkpoints(&Tenant::default(), "m", none).await;
    let kept = kept.expect("are kept");
    assert_eq!(kept.len(), 1);
    assert!(
        kept[0].kept_for.contains(&"jobs/looks".to_owned()),
        "{:?}",
        kept[0].kept_for
    );
}

/// Uploads from before there were parts, whose files are parts of writer 0: `open` goes on where it was.
pub(crate) async fn uploads_go_on(store: &Store) {
    let own = Tenant::default();
    store.end_drain().await.expect("ends");
    let committed = |upload: &Upload| upload.files.iter().map(|it| it.committed).sum::<u64>();
    let open = store.upload(&own, "open").await.expect("is kept");
    assert_eq!((committed(&open), open.pieces), (6, 2));
    let newest = open.newest.expect("has parts");
    assert_eq!(newest.id.writer, 0);
    assert_eq!(newest.object.key, "uploads/open/video.mp4");
    assert_eq!((newest.object.bytes, &*newest.object.sha256), (4, ""));
    for other in ["c", "gone"] {
        let parts = store.upload_parts(&own, other).await.expect("is kept");
        assert!(parts.is_empty(), "nobody reads {other}");
    }
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

    // A worker of an early version reads what that version has stored, and nothing else.
    let old = leased(store, JobKind::Ingest, 1).await;
    let old = old.expect("the old job waits");
    assert_eq!(old.job.name, "jobs/i");
    assert_eq!(old.inputs.parts, []);
    let object = old.inputs.files[0].object.clone().expect("is one object");
    assert_eq!(
        (&*object.key, &*object.sha256),
        ("uploads/read/poses.json", "x")
    );
    let none = leased(store, JobKind::Ingest, 1).await;
    assert!(none.is_none(), "the new job is none for it");
    let new = leased(store, JobKind::Ingest, LEVEL).await;
    let new = new.expect("the new job waits");
    assert_eq!(new.job.name, finished.ingest_job);
    assert_eq!(new.inputs.parts, [part.object]);
    let files = &new.inputs.files;
    let object = files[0].object.clone().expect("is one object");
    assert_eq!(object.key, "uploads/open/poses.json");
    let pieces: Vec<_> = files[1..].iter().flat_map(|it| &it.pieces).collect();
    let pieces: Vec<_> = pieces.iter().map(|it| (it.start, it.bytes)).collect();
    assert_eq!(pieces, [(0, 10), (10, 5)]);
}
