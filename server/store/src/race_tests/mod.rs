//! Two stores on one database of PostgreSQL, as two coordinators have them, and calls that meet: whatever the order, the
//! outcome is that of one call after the other.

mod catalogue;
mod consents;
mod leases;
mod positions;
mod renders;
mod uploads;

use crate::db::sql;
use crate::rules::retention::Retention;
use crate::scripts::queue;
use crate::stage::{DatabaseKind, Pair};
use crate::transaction::transaction;
use crate::{
    Ending, JobKind, JobVersion, LeaseKey, NewJob, NewModel, NewPart, NewPiece, NewSubject,
    NewUpload, NewWorker, Page, PartId, RequestKey, Store, StoreError, Target, Tenant,
    UploadedFile,
};
use futures::future::join_all;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use tokio::sync::Barrier;
use yoto_process::clock::{Clock, ManualClock};
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
        if !DatabaseKind::Postgres.is_there() {
            return None;
        }
        let clock = Arc::new(ManualClock::at(1e9));
        let own_clock: Arc<dyn Clock> = Arc::clone(&clock) as _;
        Some(Self {
            pair: DatabaseKind::Postgres.pair(own_clock).await,
            clock,
            own: Tenant::default(),
        })
    }

    async fn worker(&self, kinds: &[JobKind]) -> String {
        let new = NewWorker {
            key: None,
            embedded: None,
            display_name: "w".into(),
            device: WorkerDevice::default(),
            kinds: kinds.to_vec(),
            version: String::new(),
            order_level: yoto_proto::orders::LEVEL,
            reads_films: false,
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
            .finish_upload(&self.own, &upload, 0, None)
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
