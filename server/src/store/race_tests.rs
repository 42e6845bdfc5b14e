//! Two stores on one database of PostgreSQL, as two coordinators have them, and calls that meet: whatever the order, the
//! outcome is that of one call after the other.

use crate::checkpoints::retention::Retention;
use crate::clock::{Clock, ManualClock};
use crate::store::db::sql;
use crate::store::scripts::queue;
use crate::store::stage::{Kind, Pair};
use crate::store::transaction::transaction;
use crate::store::{
    CommittedPart, Ending, JobKind, LeaseKey, NewJob, NewModel, NewSubject, NewUpload, NewWorker,
    Page, RequestKey, Store, StoreError, Target, UploadedFile,
};
use crate::tenant::Tenant;
use futures::future::join_all;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use tokio::sync::Barrier;
use yoto_proto::v1::render_spec::What;
use yoto_proto::v1::{
    self, Checkpoint, ErrorReason, IngestResult, JobResult, JobSpec, ObjectRef, Orbit, RenderSpec,
    TrainResult, TrainSpec, WorkerDevice, job, job_result, job_spec,
};

const LEASE_SECONDS: f64 = 20.0;
/// How often calls meet in each test, since the order of their statements is left to chance.
const ROUNDS: u64 = 10;
/// Keeps only the newest checkpoint.
const ONE: Retention = Retention {
    newest: 1,
    every: 0,
};

/// Two stores on one database.
struct Arena {
    pair: Pair,
    clock: Arc<ManualClock>,
    own: Tenant,
}

/// The id in a resource name.
fn id(name: &str) -> String {
    name.split_once('/').expect("a resource name").1.to_owned()
}

fn object(key: &str) -> ObjectRef {
    ObjectRef {
        key: key.to_owned(),
        bytes: 1,
        sha256: "x".to_owned(),
    }
}

fn reason(error: &StoreError) -> Option<ErrorReason> {
    match error {
        StoreError::Rule { reason, .. } => Some(*reason),
        _ => None,
    }
}

impl Arena {
    async fn open() -> Option<Self> {
        if !Kind::Postgres.is_there() {
            return None;
        }
        let clock = Arc::new(ManualClock::at(1e9));
        let own_clock: Arc<dyn Clock> = Arc::clone(&clock) as _;
        Some(Self {
            pair: Kind::Postgres.pair(own_clock).await,
            clock,
            own: Tenant::default(),
        })
    }

    async fn worker(&self, kinds: &[JobKind]) -> String {
        let new = NewWorker {
            embedded: false,
            display_name: "w".into(),
            device: WorkerDevice::default(),
            kinds: kinds.to_vec(),
            version: String::new(),
            order_level: yoto_proto::orders::LEVEL,
        };
        let worker = self.pair.first.register_worker(&self.own, new).await;
        worker.expect("registers")
    }

    async fn model(&self) -> String {
        let new = NewModel {
            display_name: "m".into(),
            tier: "draft".into(),
            variant: "yoto".into(),
            retention: v1::Retention::default(),
        };
        let model = self.pair.first.create_model(&self.own, new, None).await;
        id(&model.expect("creates").name)
    }

    async fn subject(&self) -> String {
        let subject = self.pair.first.create_subject(&self.own, ada(), None).await;
        id(&subject.expect("creates").name)
    }

    /// A person with a READY capture.
    async fn ready(&self) -> String {
        let subject = self.subject().await;
        let new = NewUpload {
            subject_id: subject.clone(),
            files: Vec::new(),
        };
        let upload = self.pair.first.create_upload(&self.own, new, None).await;
        let upload = upload.expect("opens");
        let finished = self
            .pair
            .first
            .finish_upload(&self.own, &upload, None)
            .await;
        finished.expect("is complete");
        let worker = self.worker(&[JobKind::Ingest]).await;
        let lease = self
            .lease(&self.pair.first, &worker)
            .await
            .expect("the ingest waits");
        let result = IngestResult {
            shard: Some(object("shard")),
            frames: 1,
            ..IngestResult::default()
        };
        self.end(&self.pair.first, &lease, job_result::Kind::Ingest(result))
            .await
            .expect("ends");
        subject
    }

    fn training(model: &str) -> NewJob {
        order(job_spec::Kind::Train(TrainSpec {
            model: format!("models/{model}"),
            ..TrainSpec::default()
        }))
    }

    async fn train(&self, model: &str) -> String {
        let job = self
            .pair
            .first
            .create_job(&self.own, Self::training(model), None)
            .await;
        id(&job.expect("is queued").name)
    }

    async fn lease(&self, store: &Store, worker: &str) -> Option<LeaseKey> {
        self.lease_or_help(store, worker, false).await
    }

    async fn lease_or_help(&self, store: &Store, worker: &str, help: bool) -> Option<LeaseKey> {
        let outcome = store
            .lease_job(&self.own, worker, "", help, LEASE_SECONDS)
            .await
            .expect("answers");
        outcome.leased.map(|it| LeaseKey {
            job_id: id(&it.job.name),
            worker_id: worker.to_owned(),
            token: it.token,
        })
    }

    async fn end(
        &self,
        store: &Store,
        lease: &LeaseKey,
        kind: job_result::Kind,
    ) -> Result<(), StoreError> {
        let ending = Ending::Succeeded(JobResult { kind: Some(kind) });
        store.end_job(&self.own, lease, ending).await
    }

    async fn publish(&self, store: &Store, lease: &LeaseKey, step: u64) -> Result<(), StoreError> {
        let checkpoint = Checkpoint {
            step,
            manifest: Some(object(&format!("models/m/{step}/manifest.json"))),
            // The newest is the best.
            psnr: Some(step as f64),
            ..Checkpoint::default()
        };
        store
            .publish_checkpoint(&self.own, lease, checkpoint, ONE)
            .await
    }
}

fn ada() -> NewSubject {
    NewSubject {
        display_name: "Ada".into(),
        consent_note: String::new(),
    }
}

fn order(kind: job_spec::Kind) -> NewJob {
    NewJob::normal(JobSpec { kind: Some(kind) })
}

fn render(model: &str, subject: &str, checkpoint: &str) -> NewJob {
    order(job_spec::Kind::Render(RenderSpec {
        model: format!("models/{model}"),
        subject: format!("subjects/{subject}"),
        checkpoint: checkpoint.to_owned(),
        what: Some(What::Orbit(Orbit {
            frame: 0,
            views: 1,
            size: 8,
        })),
        ..RenderSpec::default()
    }))
}

#[tokio::test]
async fn each_job_is_leased_once() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    for _ in 0..ROUNDS {
        let mut jobs = BTreeSet::new();
        let mut workers = Vec::new();
        for _ in 0..6 {
            jobs.insert(arena.train(&arena.model().await).await);
            workers.push(arena.worker(&[JobKind::Train]).await);
        }
        let stores = [&arena.pair.first, &arena.pair.second].into_iter().cycle();
        let leases = stores
            .zip(&workers)
            .map(|(store, it)| arena.lease(store, it));
        let leased = join_all(leases).await;
        let leased: Vec<LeaseKey> = leased.into_iter().flatten().collect();
        let of: BTreeSet<String> = leased.iter().map(|it| it.job_id.clone()).collect();
        assert_eq!(
            (leased.len(), &of),
            (6, &jobs),
            "each worker has another job"
        );
        for lease in &leased {
            let job = arena
                .pair
                .first
                .job_history(&arena.own, &lease.job_id)
                .await;
            assert_eq!(job.expect("is there").attempts.len(), 1);
            let cancel = arena
                .pair
                .second
                .heartbeat(&arena.own, lease, None, LEASE_SECONDS)
                .await;
            cancel.expect("the lease is current");
        }
    }
}

#[tokio::test]
async fn a_job_that_is_being_leased_is_passed_over() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    let worker = arena.worker(&[JobKind::Train]).await;
    let first = arena.train(&arena.model().await).await;
    let second = arena.train(&arena.model().await).await;
    let mut tx = arena.pair.first.db.write().await.expect("begins");
    let claimed = queue::next(&mut tx, &worker).await.expect("reads");
    assert_eq!(claimed.map(|it| it.id), Some(first));
    let lease = arena.lease(&arena.pair.second, &worker).await;
    assert_eq!(lease.map(|it| it.job_id), Some(second));
}

#[tokio::test]
async fn a_transaction_that_was_rolled_back_for_another_one_is_run_again() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    let people = [arena.subject().await, arena.subject().await];
    let met = Barrier::new(2);
    let rename = async |store: &Store, order: [&String; 2]| {
        let first_try = AtomicBool::new(true);
        let done: Result<(), StoreError> = transaction!(store, |tx| async {
            for (number, person) in order.iter().enumerate() {
                sql("UPDATE subjects SET display_name = 'Eve' WHERE id = $1")
                    .bind(*person)
                    .execute(tx, "renaming a person")
                    .await?;
                if number == 0 && first_try.swap(false, Ordering::Relaxed) {
                    met.wait().await;
                }
            }
            Ok(())
        });
        done.expect("is run again");
    };
    let [one, two] = &people;
    tokio::join!(
        rename(&arena.pair.first, [one, two]),
        rename(&arena.pair.second, [two, one]),
    );
}

#[tokio::test]
async fn a_model_has_one_trainer() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    let workers = [
        arena.worker(&[JobKind::Train]).await,
        arena.worker(&[JobKind::Train]).await,
    ];
    // While no lease runs, leases follow each other anyway: each starts the lease clock.
    arena.train(&arena.model().await).await;
    let busy = arena.worker(&[JobKind::Train]).await;
    let other = arena.lease(&arena.pair.first, &busy).await;
    other.expect("the job waits");
    for _ in 0..ROUNDS {
        let model = arena.model().await;
        let (first, second) = (arena.train(&model).await, arena.train(&model).await);
        let (one, two) = tokio::join!(
            arena.lease(&arena.pair.first, &workers[0]),
            arena.lease(&arena.pair.second, &workers[1]),
        );
        assert!(one.is_some() != two.is_some(), "{one:?} {two:?}");
        for job in [first, second] {
            let cancelled = arena.pair.first.cancel_job(&arena.own, &job, None).await;
            cancelled.expect("is cancelled");
        }
        let lease = one.or(two).expect("one of them");
        let ended = arena
            .pair
            .first
            .end_job(&arena.own, &lease, Ending::Cancelled)
            .await;
        ended.expect("ends");
    }
}

#[tokio::test]
async fn a_cancel_and_a_lease_agree() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    let worker = arena.worker(&[JobKind::Train]).await;
    for _ in 0..ROUNDS {
        let job = arena.train(&arena.model().await).await;
        let (lease, cancelled) = tokio::join!(
            arena.lease(&arena.pair.first, &worker),
            arena.pair.second.cancel_job(&arena.own, &job, None),
        );
        cancelled.expect("answers");
        let after = arena
            .pair
            .first
            .job(&arena.own, &job)
            .await
            .expect("is there");
        match lease {
            None => assert_eq!(after.state(), job::State::Cancelled),
            Some(lease) => {
                assert!(after.cancel_requested, "{after:?}");
                let told = arena
                    .pair
                    .second
                    .heartbeat(&arena.own, &lease, None, LEASE_SECONDS)
                    .await;
                assert!(
                    told.expect("the lease is current"),
                    "the worker learns of it"
                );
                let ended = arena
                    .pair
                    .second
                    .end_job(&arena.own, &lease, Ending::Cancelled)
                    .await;
                ended.expect("ends");
            }
        }
    }
}

#[tokio::test]
async fn one_of_two_ends_is_accepted() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    let worker = arena.worker(&[JobKind::Train]).await;
    for _ in 0..ROUNDS {
        arena.train(&arena.model().await).await;
        let lease = arena
            .lease(&arena.pair.first, &worker)
            .await
            .expect("a job waits");
        let failed = Ending::Failed(v1::JobError::default());
        let (one, two) = tokio::join!(
            arena.end(
                &arena.pair.first,
                &lease,
                job_result::Kind::Train(TrainResult::default())
            ),
            arena.pair.second.end_job(&arena.own, &lease, failed),
        );
        assert!(one.is_ok() != two.is_ok(), "{one:?} {two:?}");
        let refused = one.and(two).expect_err("one of them");
        assert!(
            matches!(refused, StoreError::StaleLease { .. }),
            "{refused}"
        );
    }
}

#[tokio::test]
async fn a_lost_worker_is_counted_once() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    let job = arena.train(&arena.model().await).await;
    for round in 1..=3 {
        let worker = arena.worker(&[JobKind::Train]).await;
        arena
            .lease(&arena.pair.first, &worker)
            .await
            .expect("the job waits");
        let mut found = 0;
        // In ticks, so that the time is no outage.
        for _ in 0..6 {
            arena.clock.advance(LEASE_SECONDS / 4.0);
            let tick = |store| Store::tick(store, 9, LEASE_SECONDS);
            let (one, two) = tokio::join!(tick(&arena.pair.first), tick(&arena.pair.second));
            found += one.expect("ticks").len() + two.expect("ticks").len();
        }
        assert_eq!(found, 1);
        let job = arena
            .pair
            .first
            .job(&arena.own, &job)
            .await
            .expect("is there");
        assert_eq!((job.state(), job.lost_workers), (job::State::Queued, round));
    }
}

#[tokio::test]
async fn each_picture_is_drawn_by_one_worker() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    const PICTURES: u32 = 64;
    let (subject, model) = (arena.ready().await, arena.model().await);
    let added = arena
        .pair
        .first
        .add_identity(&arena.own, &model, &subject, None)
        .await;
    added.expect("gets a slot");
    let kinds = [JobKind::Train, JobKind::Render];
    let workers = [arena.worker(&kinds).await, arena.worker(&kinds).await];
    arena.train(&model).await;
    let lease = arena
        .lease(&arena.pair.first, &workers[0])
        .await
        .expect("it waits");
    arena
        .publish(&arena.pair.first, &lease, 1)
        .await
        .expect("publishes");
    let result = job_result::Kind::Train(TrainResult::default());
    arena
        .end(&arena.pair.first, &lease, result)
        .await
        .expect("ends");
    for _ in 0..ROUNDS.min(4) {
        let job = arena
            .pair
            .first
            .create_job(&arena.own, render(&model, &subject, ""), None)
            .await;
        job.expect("is queued");
        let runs = arena
            .lease(&arena.pair.first, &workers[0])
            .await
            .expect("it waits");
        let own = &arena.own;
        let take = |store, lease, drawn| Store::take_range(store, own, lease, PICTURES, drawn);
        // A copy of the first call divides the render at the same time.
        let (one, copy) = tokio::join!(
            take(&arena.pair.first, &runs, None),
            take(&arena.pair.second, &runs, None)
        );
        let mut first = one.expect("takes").range;
        assert_eq!(
            copy.expect("takes").range,
            first,
            "a copy gets the same range"
        );
        let helps = arena
            .lease_or_help(&arena.pair.second, &workers[1], true)
            .await;
        let helps = helps.expect("there is something to draw");
        let mut second = take(&arena.pair.second, &helps, None)
            .await
            .expect("takes")
            .range;
        let mut drawn = BTreeMap::new();
        while first.is_some() || second.is_some() {
            for range in [&first, &second].into_iter().flatten() {
                let earlier = drawn.insert(range.first, range.count);
                assert_eq!(earlier, None, "{range:?} is drawn twice");
            }
            let (one, two) = tokio::join!(
                take(&arena.pair.first, &runs, first.as_ref().map(|it| it.first)),
                take(
                    &arena.pair.second,
                    &helps,
                    second.as_ref().map(|it| it.first)
                ),
            );
            (first, second) = (one.expect("takes").range, two.expect("takes").range);
        }
        assert_eq!(drawn.values().sum::<u32>(), PICTURES);
        let result = job_result::Kind::Render(v1::RenderResult::default());
        arena
            .end(&arena.pair.first, &runs, result)
            .await
            .expect("ends");
    }
}

#[tokio::test]
async fn a_checkpoint_that_a_render_uses_is_kept() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    let (subject, model) = (arena.ready().await, arena.model().await);
    let added = arena
        .pair
        .first
        .add_identity(&arena.own, &model, &subject, None)
        .await;
    added.expect("gets a slot");
    let worker = arena.worker(&[JobKind::Train]).await;
    arena.train(&model).await;
    let lease = arena
        .lease(&arena.pair.first, &worker)
        .await
        .expect("it waits");
    arena
        .publish(&arena.pair.first, &lease, 1)
        .await
        .expect("publishes");
    for step in 1..=ROUNDS {
        let wanted = format!("models/{model}/checkpoints/{step}");
        let (published, queued) = tokio::join!(
            arena.publish(&arena.pair.first, &lease, step + 1),
            arena
                .pair
                .second
                .create_job(&arena.own, render(&model, &subject, &wanted), None),
        );
        published.expect("publishes");
        let all = arena.pair.first.checkpoints(&arena.own, &model, 99).await;
        let kept = all.expect("lists").iter().any(|it| it.step == step);
        match queued {
            Ok(_) => assert!(kept, "the render of step {step} has no checkpoint"),
            Err(error) => assert_eq!(reason(&error), Some(ErrorReason::NoCheckpoint), "{error}"),
        }
    }
}

#[tokio::test]
async fn a_model_is_deleted_or_trained() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    for _ in 0..ROUNDS {
        let model = arena.model().await;
        let (deleted, queued) = tokio::join!(
            arena
                .pair
                .first
                .delete(&arena.own, Target::Model(&model), "", None),
            arena
                .pair
                .second
                .create_job(&arena.own, Arena::training(&model), None),
        );
        match (deleted, queued) {
            (Ok(_), Err(StoreError::NotFound { .. })) => {}
            (Err(error), Ok(_)) => assert_eq!(reason(&error), Some(ErrorReason::ModelBusy)),
            other => panic!("{other:?}"),
        }
    }
}

#[tokio::test]
async fn a_person_is_deleted_or_uploaded() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    for _ in 0..ROUNDS {
        let subject = arena.subject().await;
        let new = NewUpload {
            subject_id: subject.clone(),
            files: Vec::new(),
        };
        let (deleted, opened) = tokio::join!(
            arena
                .pair
                .first
                .delete(&arena.own, Target::Subject(&subject), "", None),
            arena.pair.second.create_upload(&arena.own, new, None),
        );
        let captures = deleted.expect("nobody uses it").captures;
        match opened {
            Ok(_) => assert_eq!(captures, 1, "the upload goes with its person"),
            Err(error) => assert!(matches!(error, StoreError::NotFound { .. }), "{error}"),
        }
    }
}

#[tokio::test]
async fn a_repeated_request_is_answered_once() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    for round in 0..ROUNDS {
        let request = || {
            Some(RequestKey {
                method: "CreateSubject",
                request_id: format!("{round}"),
                body_sha256: String::new(),
            })
        };
        let (one, two) = tokio::join!(
            arena
                .pair
                .first
                .create_subject(&arena.own, ada(), request()),
            arena
                .pair
                .second
                .create_subject(&arena.own, ada(), request()),
        );
        assert_eq!(one.expect("answers"), two.expect("answers"));
    }
    let page = Page {
        limit: 99,
        after: None,
    };
    let all = arena
        .pair
        .first
        .subjects(&arena.own, page)
        .await
        .expect("lists");
    assert_eq!(all.len() as u64, ROUNDS);
}

#[tokio::test]
async fn one_of_two_writers_of_an_upload_is_accepted() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    let subject = arena.subject().await;
    for _ in 0..ROUNDS {
        let file = UploadedFile {
            path: "poses.json".into(),
            bytes: 10,
            sha256: String::new(),
        };
        let new = NewUpload {
            subject_id: subject.clone(),
            files: vec![file],
        };
        let upload = arena.pair.first.create_upload(&arena.own, new, None).await;
        let upload = upload.expect("opens");
        let write = async |store: &Store, to| {
            let writer = store.take_over_upload(&arena.own, &upload).await;
            let part = CommittedPart {
                path: "poses.json".into(),
                from: 0,
                to,
            };
            let writer = writer.expect("is open");
            store
                .commit_parts(&arena.own, &upload, writer, &[part])
                .await
        };
        let (one, two) = tokio::join!(write(&arena.pair.first, 4), write(&arena.pair.second, 10));
        let expected = if one.is_ok() { 4 } else { 10 };
        assert!(one.is_ok() != two.is_ok(), "{one:?} {two:?}");
        let refused = one.and(two).expect_err("one of them");
        let late = [ErrorReason::UploadOffset, ErrorReason::UploadTakenOver];
        assert!(
            reason(&refused).is_some_and(|it| late.contains(&it)),
            "{refused}"
        );
        let after = arena
            .pair
            .second
            .upload(&arena.own, &upload)
            .await
            .expect("is open");
        assert_eq!(after.files[0].committed, expected);
    }
}

#[tokio::test]
async fn each_person_of_a_model_has_a_slot() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    let people = [arena.ready().await, arena.ready().await];
    for _ in 0..ROUNDS {
        let model = arena.model().await;
        let add = |store, person| Store::add_identity(store, &arena.own, &model, person, None);
        let (one, two, again) = tokio::join!(
            add(&arena.pair.first, &people[0]),
            add(&arena.pair.second, &people[1]),
            add(&arena.pair.second, &people[0]),
        );
        let (one, two) = (one.expect("a slot").slot, two.expect("a slot").slot);
        assert_eq!(again.expect("the same slot").slot, one);
        assert_eq!(BTreeSet::from([one, two]), BTreeSet::from([0, 1]));
    }
}
