//! What was chosen is taken only if it is still as it was: another transaction may have changed it, on a database with
//! several writers. Here the change comes between the two steps of one transaction.

use super::{helpers, jobs, leases, queue, reaping, requests};
use crate::db::{Tx, sql};
use crate::stage::{DatabaseKind, Staged, on_each_database};
use crate::{JobKind, LeaseKey, NewModel, NewWorker, RequestKey, StoreError, Tenant};
use std::sync::Arc;
use yoto_process::clock::{Clock, ManualClock};
use yoto_process::statements::counted;
use yoto_proto::v1::{Progress, Retention, TrainSpec, WorkerDevice, job_spec};

const LEASE_SECONDS: f64 = 20.0;

/// A store with a worker and a queued training.
struct Stage {
    staged: Staged,
    clock: Arc<ManualClock>,
    worker: String,
    job: String,
    model: String,
}

fn own() -> Tenant {
    Tenant::default()
}

impl Stage {
    async fn new(kind: DatabaseKind) -> Self {
        let clock = Arc::new(ManualClock::at(1e9));
        let own_clock: Arc<dyn Clock> = Arc::clone(&clock) as _;
        let staged = kind.store(own_clock).await;
        let store = &staged.store;
        let worker = NewWorker {
            key: None,
            display_name: "w".into(),
            device: WorkerDevice::default(),
            kinds: vec![JobKind::Train, JobKind::Render],
            embedded: None,
            version: String::new(),
            order_level: 1,
            reads_films: false,
        };
        let worker = store
            .register_worker(&own(), worker)
            .await
            .expect("registers");
        let model = NewModel {
            display_name: "m".into(),
            tier: "draft".into(),
            variant: "yoto".into(),
            retention: Retention::default(),
        };
        let model = store
            .create_model(&own(), model, None)
            .await
            .expect("creates");
        let mut stage = Self {
            staged,
            clock,
            worker,
            job: String::new(),
            model: model.name,
        };
        stage.job = stage.train().await;
        stage
    }

    /// Queues a training of the model. Returns its id.
    async fn train(&self) -> String {
        let spec = job_spec::Kind::Train(TrainSpec {
            model: self.model.clone(),
            ..TrainSpec::default()
        });
        let spec = yoto_proto::v1::JobSpec { kind: Some(spec) };
        let new = crate::NewJob::normal(spec);
        let job = self
            .staged
            .store
            .create_job(&own(), new, None)
            .await
            .expect("is queued");
        job.name.trim_start_matches("jobs/").to_owned()
    }

    fn ask<'a>(&'a self, tenant: &'a Tenant) -> leases::Ask<'a> {
        leases::Ask {
            tenant,
            worker_id: &self.worker,
            request_id: "",
            help: false,
            lease_seconds: LEASE_SECONDS,
            requires_consent: false,
        }
    }

    async fn write(&self) -> Tx {
        self.staged.store.db.write().await.expect("begins")
    }
}

on_each_database!(
    a_job_that_has_left_the_queue_is_not_leased,
    a_model_gets_no_second_trainer,
    nobody_helps_with_a_job_that_has_ended,
    a_lease_that_was_extended_after_it_was_found_is_kept,
    a_request_is_taken_before_it_has_an_answer,
    a_cancel_ends_or_marks_a_job_whatever_happened_before,
    what_workers_call_all_the_time_is_one_statement,
);

/// Chooses the next job, lets `change` happen, and begins the lease of what was chosen.
async fn begin_after(
    stage: &Stage,
    tx: &mut Tx,
    change: &'static str,
) -> Result<Option<LeaseKey>, StoreError> {
    let next = queue::next(tx, &stage.worker).await.expect("reads");
    let next = next.expect("a job waits").id;
    let changed = sql(change).bind(&stage.job).execute(tx, "changing").await;
    assert_eq!(changed.expect("changes"), 1);
    leases::begin(tx, &stage.ask(&own()), &next).await
}

async fn a_job_that_has_left_the_queue_is_not_leased(kind: DatabaseKind) {
    let stage = Stage::new(kind).await;
    let mut tx = stage.write().await;
    let cancel = "UPDATE jobs SET state = 'CANCELLED', end_time = 1 WHERE id = $1";
    let begun = begin_after(&stage, &mut tx, cancel).await;
    assert_eq!(begun.expect("answers"), None);
}

async fn a_model_gets_no_second_trainer(kind: DatabaseKind) {
    let stage = Stage::new(kind).await;
    let second = stage.train().await;
    let mut tx = stage.write().await;
    let begun = leases::begin(&mut tx, &stage.ask(&own()), &stage.job).await;
    assert!(begun.expect("answers").is_some());
    let begun = leases::begin(&mut tx, &stage.ask(&own()), &second).await;
    assert_eq!(begun.expect("is no conflict"), None);
}

async fn nobody_helps_with_a_job_that_has_ended(kind: DatabaseKind) {
    let stage = Stage::new(kind).await;
    let mut tx = stage.write().await;
    let helping = helpers::begin(&mut tx, &stage.ask(&own()), &stage.job).await;
    assert_eq!(helping.expect("answers"), None, "it does not run");
}

async fn a_lease_that_was_extended_after_it_was_found_is_kept(kind: DatabaseKind) {
    let stage = Stage::new(kind).await;
    let own = own();
    let leased = (stage.staged.store)
        .lease_job(&own, &stage.worker, "", false, LEASE_SECONDS)
        .await
        .expect("answers");
    let leased = leased.leased.expect("the job waits");
    let lease = LeaseKey {
        job_id: stage.job.clone(),
        worker_id: stage.worker.clone(),
        token: leased.token,
    };
    // Ticks, so that the time is no outage.
    for _ in 0..5 {
        stage.clock.advance(5.0);
        let mut tx = stage.write().await;
        let lost = reaping::tick(&mut tx, LEASE_SECONDS).await.expect("ticks");
        tx.commit().await.expect("commits");
        let Some(lost) = lost.first() else { continue };
        let beat = stage
            .staged
            .store
            .heartbeat(&own, &lease, None, LEASE_SECONDS)
            .await;
        beat.expect("the lease is still held");
        let mut tx = stage.write().await;
        let reaped = reaping::take_back(&mut tx, lost, 5).await.expect("answers");
        assert!(reaped.is_none(), "it was extended");
        return;
    }
    panic!("the lease never expired");
}

/// Workers report twice per second and ask every second or two: each statement more is a load of the whole cluster.
async fn what_workers_call_all_the_time_is_one_statement(kind: DatabaseKind) {
    let stage = Stage::new(kind).await;
    let (own, store) = (own(), &stage.staged.store);
    let ask = || store.lease_job(&own, &stage.worker, "", true, LEASE_SECONDS);
    let leased = ask().await.expect("answers").leased;
    let lease = LeaseKey {
        job_id: stage.job.clone(),
        worker_id: stage.worker.clone(),
        token: leased.expect("the job waits").token,
    };
    let (asked, statements) = counted(ask()).await;
    assert!(asked.expect("answers").leased.is_none());
    assert_eq!(statements, 1, "a request without success");
    let beat = |progress| store.heartbeat(&own, &lease, progress, LEASE_SECONDS);
    let plain = Progress {
        step: 3,
        ..Progress::default()
    };
    let (beaten, statements) = counted(beat(Some(plain))).await;
    assert!(!beaten.expect("holds the lease"));
    assert_eq!(statements, 1, "a report");
    for (step, expected) in [(4, 2), (4, 1)] {
        let figures = Progress {
            step,
            loss: Some(0.5),
            ..Progress::default()
        };
        let (beaten, statements) = counted(beat(Some(figures))).await;
        assert!(!beaten.expect("holds the lease"));
        assert_eq!(statements, expected, "a report with figures of step {step}");
    }
}

async fn a_request_is_taken_before_it_has_an_answer(kind: DatabaseKind) {
    let stage = Stage::new(kind).await;
    let request = |body: &str| RequestKey {
        method: "CreateModel",
        request_id: "r".into(),
        body_sha256: body.into(),
    };
    let mut tx = stage.write().await;
    let (first, other) = (request("a"), request("b"));
    let began = requests::begin(&mut tx, &own(), Some(&first)).await;
    assert_eq!(began.expect("is taken"), None);
    let remembered = requests::remember(&mut tx, &own(), Some(&first), "answer").await;
    remembered.expect("is stored");
    let again = requests::begin(&mut tx, &own(), Some(&first)).await;
    assert_eq!(again.expect("repeats").as_deref(), Some("answer"));
    let reused = requests::begin(&mut tx, &own(), Some(&other)).await;
    assert!(matches!(reused, Err(StoreError::RequestIdReused { .. })));
}

async fn a_cancel_ends_or_marks_a_job_whatever_happened_before(kind: DatabaseKind) {
    let stage = Stage::new(kind).await;
    let mut tx = stage.write().await;
    let begun = leases::begin(&mut tx, &stage.ask(&own()), &stage.job).await;
    assert!(begun.expect("answers").is_some());
    let job = jobs::cancel(&mut tx, &own(), &stage.job, None).await;
    assert!(job.expect("is marked").cancel_requested);
}
