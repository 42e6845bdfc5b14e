//! Two coordinators on one database: what one has decided, the other one knows.

use crate::clock::{Clock, ManualClock};
use crate::store::db::sql;
use crate::store::{
    CommittedPart, JobKind, NewSubject, NewUpload, NewWorker, Store, StoreError, UploadedFile,
};
use crate::tenant::Tenant;
use std::sync::{Arc, LazyLock};
use yoto_proto::names::Collection;
use yoto_proto::v1::{ErrorReason, WorkerDevice};

const DAY: f64 = 24.0 * 3600.0;

struct Two {
    first: Store,
    second: Store,
    clock: Arc<ManualClock>,
    _dir: tempfile::TempDir,
}

fn own() -> &'static Tenant {
    static OWN: LazyLock<Tenant> = LazyLock::new(Tenant::default);
    &OWN
}

impl Two {
    async fn new() -> Self {
        let dir = tempfile::tempdir().expect("a folder");
        let clock = Arc::new(ManualClock::at(1e9));
        let open = async || {
            let clock: Arc<dyn Clock> = Arc::clone(&clock) as _;
            let opened = Store::open_sqlite(&dir.path().join("yoto.db"), clock).await;
            opened.expect("opens")
        };
        Self {
            first: open().await,
            second: open().await,
            clock: Arc::clone(&clock),
            _dir: dir,
        }
    }

    /// Opens an upload of ten bytes. Returns its id.
    async fn upload(&self) -> String {
        let ada = NewSubject {
            display_name: "Ada".to_owned(),
            consent_note: String::new(),
        };
        let ada = self.first.create_subject(own(), ada, None).await;
        let ada = ada.expect("creates").name;
        let subject_id = Collection::Subjects.parse(&ada).expect("an id").to_owned();
        let file = UploadedFile {
            path: "poses.json".to_owned(),
            bytes: 10,
            sha256: String::new(),
        };
        let new = NewUpload {
            subject_id,
            files: vec![file],
        };
        let opened = self.first.create_upload(own(), new, None).await;
        opened.expect("opens")
    }

    /// An upload whose capture was rejected. Returns its id.
    async fn rejected(&self) -> String {
        let id = self.upload().await;
        let mut tx = self.first.db.write().await.expect("begins");
        sql("UPDATE captures SET state = 'REJECTED' WHERE id = $1")
            .bind(&id)
            .execute(&mut tx, "rejecting")
            .await
            .expect("rejects");
        tx.commit().await.expect("commits");
        id
    }

    async fn steps(&self) -> i64 {
        let mut tx = self.first.db.read().await.expect("reads");
        let counted = sql("SELECT count(*) AS steps FROM clock_steps");
        let row = counted.one(&mut tx, "counting").await.expect("counts");
        row.number("steps").expect("a number")
    }
}

fn is_refused<T: std::fmt::Debug>(answer: Result<T, StoreError>, expected: ErrorReason) {
    match answer {
        Err(StoreError::Rule { reason, .. }) => assert_eq!(reason, expected),
        other => panic!("{other:?} instead of {expected:?}"),
    }
}

#[tokio::test]
async fn a_step_of_the_clock_is_recorded_once() {
    let two = Two::new().await;
    // To the second one, the time since the first one's check is time while the service was down.
    for store in [&two.first, &two.second] {
        store.keep_time().await.expect("writes");
    }
    for step in [-DAY, DAY] {
        let before = two.steps().await;
        for _ in 0..3 {
            for store in [&two.first, &two.second] {
                two.clock.advance(2.5);
                store.keep_time().await.expect("writes");
            }
        }
        assert_eq!(two.steps().await, before, "time passes");
        two.clock.set_ahead(step);
        for store in [&two.first, &two.second, &two.first] {
            two.clock.advance(2.5);
            store.keep_time().await.expect("writes");
        }
        assert_eq!(two.steps().await, before + 1, "a step of {step} s");
    }
}

#[tokio::test]
async fn only_the_newest_writer_of_an_upload_commits() {
    let two = Two::new().await;
    let id = two.upload().await;
    let part = |from, to| {
        [CommittedPart {
            path: "poses.json".to_owned(),
            from,
            to,
        }]
    };
    let first = two.first.take_over_upload(own(), &id).await;
    let first = first.expect("is there");
    let (begin, middle, rest) = (part(0, 4), part(4, 6), part(4, 10));
    let committed = two.first.commit_parts(own(), &id, first, &begin);
    committed.await.expect("is the newest");
    let second = two.second.take_over_upload(own(), &id).await;
    let second = second.expect("is there");
    let late = (two.first).commit_parts(own(), &id, first, &middle);
    is_refused(late.await, ErrorReason::UploadTakenOver);
    let late = (two.first).restart_file(own(), &id, first, "poses.json");
    late.await.expect("changes nothing");
    let committed = (two.second).commit_parts(own(), &id, second, &rest);
    committed.await.expect("follows what was committed");
    let none = two.first.take_over_upload(own(), "nothing").await;
    assert!(matches!(none, Err(StoreError::NotFound { .. })), "{none:?}");
}

#[tokio::test]
async fn files_are_removed_or_read_again_but_not_both() {
    let two = Two::new().await;
    let (removed, read) = (two.rejected().await, two.rejected().await);
    assert!(two.first.release_upload(&removed, 0.0).await.expect("ends"));
    let again = two.second.ingest_capture(own(), &removed, None).await;
    is_refused(again, ErrorReason::UploadGone);
    let again = two.second.ingest_capture(own(), &read, None).await;
    again.expect("is queued");
    let released = two.first.release_upload(&read, 0.0).await;
    assert!(!released.expect("ends"), "an ingest job names them");
}

#[tokio::test]
async fn a_worker_that_asked_one_coordinator_is_known_to_the_other() {
    let two = Two::new().await;
    let worker = NewWorker {
        display_name: "w".to_owned(),
        device: WorkerDevice::default(),
        kinds: vec![JobKind::Train],
        embedded: false,
        version: String::new(),
        order_level: 1,
    };
    let id = two.first.register_worker(own(), worker).await;
    let id = id.expect("registers");
    let active = async || two.second.active_workers(own(), 20.0).await.expect("reads");
    assert_eq!(active().await, [], "it has not asked");
    let ask = async || {
        let asked = two.first.lease_job(own(), &id, "", false, 20.0).await;
        assert!(asked.expect("answers").leased.is_none());
    };
    let seen = async || Some(active().await.first()?.last_seen?.seconds);
    ask().await;
    two.clock.advance(20.0);
    ask().await;
    assert_eq!(seen().await, Some(1_000_000_000), "one write is enough");
    two.clock.advance(20.0);
    ask().await;
    assert_eq!(seen().await, Some(1_000_000_040));
    // A clock that was set back hides nobody.
    two.clock.set_ahead(-DAY);
    assert_eq!(active().await.len(), 1);
    ask().await;
    two.clock.advance(601.0);
    assert_eq!(active().await, [], "it has been silent for ten minutes");
}
