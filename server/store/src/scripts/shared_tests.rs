//! Two coordinators on one database: what one has decided, the other one knows.

use crate::db::sql;
use crate::stage::{DatabaseKind, Pair, on_each_database};
use crate::{
    JobKind, NewPart, NewPiece, NewSubject, NewUpload, NewWorker, PartId, StoreError, Tenant,
    UploadedFile,
};
use std::sync::{Arc, LazyLock};
use yoto_process::clock::{Clock, ManualClock};
use yoto_proto::names::Collection;
use yoto_proto::v1::{ErrorReason, ObjectRef, WorkerDevice};

const DAY: f64 = 24.0 * 3600.0;

struct Two {
    pair: Pair,
    clock: Arc<ManualClock>,
}

fn own() -> &'static Tenant {
    static OWN: LazyLock<Tenant> = LazyLock::new(Tenant::default);
    &OWN
}

impl Two {
    async fn new(kind: DatabaseKind) -> Self {
        let clock = Arc::new(ManualClock::at(1e9));
        let own_clock: Arc<dyn Clock> = Arc::clone(&clock) as _;
        let pair = kind.pair(own_clock).await;
        Self { pair, clock }
    }

    /// Opens an upload of ten bytes. Returns its id.
    async fn upload(&self) -> String {
        let ada = NewSubject {
            display_name: "Ada".to_owned(),
            consent_note: String::new(),
        };
        let ada = self.pair.first.create_subject(own(), ada, None).await;
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
        let opened = self.pair.first.create_upload(own(), new, None).await;
        opened.expect("opens")
    }

    /// An upload whose capture was rejected. Returns its id.
    async fn rejected(&self) -> String {
        let id = self.upload().await;
        let mut tx = self.pair.first.db.write().await.expect("begins");
        sql("UPDATE captures SET state = 'REJECTED' WHERE id = $1")
            .bind(&id)
            .execute(&mut tx, "rejecting")
            .await
            .expect("rejects");
        tx.commit().await.expect("commits");
        id
    }

    async fn steps(&self) -> i64 {
        let mut tx = self.pair.first.db.read().await.expect("reads");
        let counted = sql("SELECT count(*) AS steps FROM clock_steps");
        let row = counted.one(&mut tx, "counting").await.expect("counts");
        row.number("steps").expect("a number")
    }
}

on_each_database!(
    a_step_of_the_clock_is_recorded_once,
    only_the_newest_writer_of_an_upload_commits,
    a_part_is_committed_once_at_any_coordinator_by_its_tenant,
    a_small_part_is_replaced_by_a_larger_one,
    files_are_removed_or_read_again_but_not_both,
    a_worker_that_asked_one_coordinator_is_known_to_the_other,
);

fn is_refused<T: std::fmt::Debug>(answer: Result<T, StoreError>, expected: ErrorReason) {
    match answer {
        Err(StoreError::Rule { reason, .. }) => assert_eq!(reason, expected),
        other => panic!("{other:?} instead of {expected:?}"),
    }
}

async fn a_step_of_the_clock_is_recorded_once(kind: DatabaseKind) {
    let two = Two::new(kind).await;
    // To the second one, the time since the first one's check is time while the service was down.
    for store in [&two.pair.first, &two.pair.second] {
        store.keep_time().await.expect("writes");
    }
    for step in [-DAY, DAY] {
        let before = two.steps().await;
        for _ in 0..3 {
            for store in [&two.pair.first, &two.pair.second] {
                two.clock.advance(2.5);
                store.keep_time().await.expect("writes");
            }
        }
        assert_eq!(two.steps().await, before, "time passes");
        two.clock.set_ahead(step);
        for store in [&two.pair.first, &two.pair.second, &two.pair.first] {
            two.clock.advance(2.5);
            store.keep_time().await.expect("writes");
        }
        assert_eq!(two.steps().await, before + 1, "a step of {step} s");
    }
}

/// A part of `writer` that has bytes of the only file.
fn part(writer: u64, number: u64, from: u64, to: u64) -> NewPart {
    NewPart {
        id: PartId { writer, number },
        object: ObjectRef {
            key: format!("{writer}-{number}"),
            bytes: to - from,
            sha256: "x".to_owned(),
        },
        pieces: vec![NewPiece {
            path: "poses.json".to_owned(),
            from,
            to,
        }],
        replaces: None,
    }
}

/// The part of `writer` that was never recorded.
fn late_id(writer: u64) -> PartId {
    PartId { writer, number: 1 }
}

async fn a_part_is_committed_once_at_any_coordinator_by_its_tenant(kind: DatabaseKind) {
    let two = Two::new(kind).await;
    let id = two.upload().await;
    let writer = two.pair.first.take_over_upload(own(), &id).await;
    let part = part(writer.expect("is there"), 0, 0, 4);
    let other = Tenant::new("other").expect("an id");
    for is_new in [true, false] {
        let theirs = two.pair.first.commit_signed_part(&other, &id, &part).await;
        assert!(
            matches!(theirs, Err(StoreError::NotFound { .. })),
            "{theirs:?}"
        );
        let committed = two.pair.second.commit_signed_part(own(), &id, &part);
        assert_eq!(committed.await.expect("is the newest"), is_new);
    }
    let parts = two.pair.first.upload_parts(own(), &id).await;
    assert_eq!(parts.expect("is there").len(), 1);
}

async fn only_the_newest_writer_of_an_upload_commits(kind: DatabaseKind) {
    let two = Two::new(kind).await;
    let id = two.upload().await;
    let first = two.pair.first.take_over_upload(own(), &id).await;
    let first = first.expect("is there");
    let begin = part(first, 0, 0, 4);
    let committed = two.pair.first.commit_part(own(), &id, &begin);
    committed.await.expect("is the newest");
    let second = two.pair.second.take_over_upload(own(), &id).await;
    let second = second.expect("is there");
    let late_part = part(first, 1, 4, 6);
    is_refused(
        two.pair.first.commit_part(own(), &id, &late_part).await,
        ErrorReason::UploadTakenOver,
    );
    let paths = ["poses.json".to_owned()];
    let late = (two.pair.first).restart_files(own(), &id, first, &paths);
    late.await.expect("changes nothing");
    let keys = [begin.id, late_id(first), late_id(second)];
    let orphans = two.pair.first.orphans_of_upload(&id, &keys).await;
    assert_eq!(
        orphans.expect("reads"),
        [late_id(first)],
        "the newest writer may commit its own yet"
    );
    let rest = part(second, 0, 4, 10);
    let committed = two.pair.second.commit_part(own(), &id, &rest);
    committed.await.expect("follows what was committed");
    let finished = two.pair.first.finish_upload(own(), &id, first, None).await;
    is_refused(finished, ErrorReason::UploadTakenOver);
    let parts = two.pair.first.upload_parts(own(), &id).await;
    let parts = parts.expect("is there");
    let pieces: Vec<_> = parts
        .iter()
        .flat_map(|it| it.part.pieces.iter().map(move |piece| (it.id, piece)))
        .map(|(id, piece)| (id.writer, piece.offset, piece.bytes))
        .collect();
    assert_eq!(pieces, [(first, 0, 4), (second, 4, 6)]);
    let finished = two.pair.second.finish_upload(own(), &id, second, None);
    finished.await.expect("is complete");
    is_refused(
        two.pair.first.commit_part(own(), &id, &late_part).await,
        ErrorReason::UploadTakenOver,
    );
    let none = two.pair.first.take_over_upload(own(), "nothing").await;
    assert!(matches!(none, Err(StoreError::NotFound { .. })), "{none:?}");
}

async fn a_small_part_is_replaced_by_a_larger_one(kind: DatabaseKind) {
    let two = Two::new(kind).await;
    let id = two.upload().await;
    let store = &two.pair.first;
    let writer = store.take_over_upload(own(), &id).await;
    let writer = writer.expect("is there");
    let begin = part(writer, 0, 0, 4);
    let committed = store.commit_part(own(), &id, &begin).await;
    committed.expect("is the newest");
    let mut whole = part(writer, 1, 4, 7);
    whole.object.bytes = 7;
    whole.replaces = Some(begin.id);
    let committed = store.commit_part(own(), &id, &whole).await;
    committed.expect("replaces the first one");
    let upload = store.upload(own(), &id).await.expect("is there");
    assert_eq!((upload.files[0].committed, upload.pieces), (7, 1));
    let newest = upload.newest.expect("has parts");
    assert_eq!((newest.id, newest.object.bytes), (whole.id, 7));
    let parts = store.upload_parts(own(), &id).await.expect("reads");
    let piece = &parts[0].part.pieces[0];
    assert_eq!((parts.len(), piece.start, piece.bytes), (1, 0, 7));
    // It is replaced already: the transaction leaves nothing.
    let mut again = part(writer, 2, 7, 10);
    again.replaces = Some(begin.id);
    let refused = store.commit_part(own(), &id, &again).await;
    assert!(
        matches!(refused, Err(StoreError::Corrupt { .. })),
        "{refused:?}"
    );
    let upload = store.upload(own(), &id).await.expect("is there");
    assert_eq!(upload.files[0].committed, 7);

    let paths = ["poses.json".to_owned()];
    let restarted = store.restart_files(own(), &id, writer, &paths).await;
    restarted.expect("is the newest");
    let upload = store.upload(own(), &id).await.expect("is there");
    assert_eq!((upload.files[0].committed, upload.pieces), (0, 0));
    assert_eq!(upload.newest, None, "a part without pieces is garbage");
}

async fn files_are_removed_or_read_again_but_not_both(kind: DatabaseKind) {
    let two = Two::new(kind).await;
    let (removed, read) = (two.rejected().await, two.rejected().await);
    assert!(
        two.pair
            .first
            .release_upload(&removed, 0.0)
            .await
            .expect("ends")
    );
    let again = two.pair.second.ingest_capture(own(), &removed, None).await;
    is_refused(again, ErrorReason::UploadGone);
    let again = two.pair.second.ingest_capture(own(), &read, None).await;
    again.expect("is queued");
    let released = two.pair.first.release_upload(&read, 0.0).await;
    assert!(!released.expect("ends"), "an ingest job names them");
}

async fn a_worker_that_asked_one_coordinator_is_known_to_the_other(kind: DatabaseKind) {
    let two = Two::new(kind).await;
    let worker = NewWorker {
        key: None,
        display_name: "w".to_owned(),
        device: WorkerDevice::default(),
        kinds: vec![JobKind::Train],
        embedded: None,
        version: String::new(),
        order_level: 1,
        reads_films: false,
    };
    let id = two.pair.first.register_worker(own(), worker).await;
    let id = id.expect("registers");
    let active = async || {
        two.pair
            .second
            .active_workers(own(), 20.0)
            .await
            .expect("reads")
    };
    assert_eq!(active().await, [], "it has not asked");
    let ask = async || {
        let asked = two.pair.first.lease_job(own(), &id, "", false, 20.0).await;
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
