//! The store on SQLite: one process, one file, durable at every commit.
//!
//! All writes go through one connection and start with `BEGIN IMMEDIATE`, so a write never
//! fails because of an earlier read; readers have their own connections and never wait.

mod attempts;
mod capture_objects;
mod captures;
mod checkpoints;
mod connections;
mod deletion;
mod failures;
mod garbage;
mod helpers;
mod inputs;
mod jobs;
mod leases;
mod metrics;
mod migrations;
mod models;
mod outcome;
mod outputs;
mod pauses;
mod pins;
mod queue;
mod ranges;
mod reaping;
mod requests;
mod rows;
mod steps;
mod subjects;
mod ticks;

#[cfg(test)]
mod upgrade_tests;
mod uploads;
mod versions;
mod workers;

use super::{
    CommittedPart, Ending, Entry, Horizons, JobFilter, JobKind, JobVersions, KnownGarbage,
    LeaseKey, LeaseOutcome, NewJob, NewModel, NewSubject, NewUpload, NewWorker, Page, Reaped,
    Reference, RequestKey, Store, StoreError, SubjectChange, TakenRange, Target, Upload,
    UploadedFile,
};
use crate::checkpoints::retention::Retention;
use crate::clock::Clock;
use crate::faults::{self, Moment};
use crate::rules::steps::Reading;
use async_trait::async_trait;
use rows::During;
use sqlx::pool::PoolConnection;
use sqlx::{Acquire, Sqlite, SqlitePool, Transaction};
use std::path::Path;
use std::sync::Arc;
use tokio::sync::Mutex;
use yoto_proto::v1::{
    self, Capture, Checkpoint, Deleted, IdentitySlot, Job, JobMetrics, JobSpec, Model, PausedKind,
    Progress, RenderedFile, Subject, WorkerStatus,
};
use yoto_proto::worker::v1::SubjectShard;

/// The SQLite store; see the module's documentation.
#[derive(Debug)]
pub struct SqliteStore {
    writer: SqlitePool,
    readers: SqlitePool,
    clock: Arc<dyn Clock>,
    /// Reading of both clocks at the first check of this process, or after the last step of the clock.
    first_reading: Mutex<Option<Reading>>,
}

impl SqliteStore {
    /// Opens the database file, creating it and bringing its schema up to date. Jobs and leases run by
    /// `clock`.
    ///
    /// # Errors
    /// When the file can't be opened, or holds a schema that is newer or altered.
    pub async fn open(path: &Path, clock: Arc<dyn Clock>) -> Result<Self, StoreError> {
        let writer = connections::writer(path).await?;
        migrations::migrations()
            .run(&writer)
            .await
            .map_err(sqlx::Error::from)
            .during("bringing the database's schema up to date")?;
        let readers = connections::readers(path).await?;
        Ok(Self {
            writer,
            readers,
            clock,
            first_reading: Mutex::default(),
        })
    }

    async fn read(&self) -> Result<PoolConnection<Sqlite>, StoreError> {
        self.readers
            .acquire()
            .await
            .during("waiting for a database connection")
    }

    async fn write(&self) -> Result<Transaction<'static, Sqlite>, StoreError> {
        self.writer
            .begin_with("BEGIN IMMEDIATE")
            .await
            .during("starting a transaction")
    }
}

async fn commit(tx: Transaction<'static, Sqlite>) -> Result<(), StoreError> {
    faults::reached(Moment::BeforeCommit);
    tx.commit().await.during("committing a transaction")?;
    faults::reached(Moment::AfterCommit);
    Ok(())
}

#[async_trait]
impl Store for SqliteStore {
    async fn create_subject(
        &self,
        new: NewSubject,
        request: Option<RequestKey>,
    ) -> Result<Subject, StoreError> {
        let mut tx = self.write().await?;
        let subject = subjects::create(&mut tx, new, request, self.clock.now()).await?;
        commit(tx).await?;
        Ok(subject)
    }

    async fn subject(&self, id: &str) -> Result<Subject, StoreError> {
        subjects::get(&mut *self.read().await?, id).await
    }

    async fn subjects(&self, page: Page) -> Result<Vec<Entry<Subject>>, StoreError> {
        subjects::list(&mut *self.read().await?, page).await
    }

    async fn update_subject(
        &self,
        id: &str,
        change: SubjectChange,
        etag: &str,
    ) -> Result<Subject, StoreError> {
        let mut tx = self.write().await?;
        let subject = subjects::update(&mut tx, id, change, etag).await?;
        commit(tx).await?;
        Ok(subject)
    }

    async fn shard(&self, subject_id: &str) -> Result<Option<SubjectShard>, StoreError> {
        subjects::shard(&mut *self.read().await?, subject_id).await
    }

    async fn create_upload(
        &self,
        new: NewUpload,
        request: Option<RequestKey>,
    ) -> Result<String, StoreError> {
        let mut tx = self.write().await?;
        let id = uploads::create(&mut tx, new, request, self.clock.now()).await?;
        commit(tx).await?;
        Ok(id)
    }

    async fn upload(&self, id: &str) -> Result<Upload, StoreError> {
        let mut conn = self.read().await?;
        // In a transaction, so that both reads see the same state.
        let mut tx = conn.begin().await.during("starting to read an upload")?;
        uploads::get(&mut tx, id).await
    }

    async fn commit_parts(&self, id: &str, parts: &[CommittedPart]) -> Result<(), StoreError> {
        let mut tx = self.write().await?;
        uploads::commit(&mut tx, id, parts, self.clock.now()).await?;
        commit(tx).await
    }

    async fn restart_file(&self, id: &str, path: &str) -> Result<(), StoreError> {
        let mut tx = self.write().await?;
        uploads::restart(&mut tx, id, path).await?;
        commit(tx).await
    }

    async fn finish_upload(
        &self,
        id: &str,
        request: Option<RequestKey>,
    ) -> Result<Capture, StoreError> {
        let mut tx = self.write().await?;
        let capture = uploads::finish(&mut tx, id, request, self.clock.now()).await?;
        commit(tx).await?;
        Ok(capture)
    }

    async fn expire_uploads(&self, idle_seconds: f64) -> Result<Vec<String>, StoreError> {
        let now = self.keep_time().await?;
        let mut tx = self.write().await?;
        let ended = uploads::expire(&mut tx, idle_seconds, now).await?;
        commit(tx).await?;
        Ok(ended)
    }

    async fn ingest_capture(
        &self,
        id: &str,
        request: Option<RequestKey>,
    ) -> Result<Capture, StoreError> {
        let mut tx = self.write().await?;
        let capture = uploads::ingest_again(&mut tx, id, request, self.clock.now()).await?;
        commit(tx).await?;
        Ok(capture)
    }

    async fn answered(&self, request: Option<&RequestKey>) -> Result<Option<String>, StoreError> {
        requests::answered(&mut *self.read().await?, request).await
    }

    async fn capture_files(&self, id: &str) -> Result<Vec<UploadedFile>, StoreError> {
        captures::files(&mut *self.read().await?, id).await
    }

    async fn capture(&self, id: &str) -> Result<Capture, StoreError> {
        captures::get(&mut *self.read().await?, id).await
    }

    async fn captures(
        &self,
        page: Page,
        subject_id: Option<&str>,
    ) -> Result<Vec<Entry<Capture>>, StoreError> {
        captures::list(&mut *self.read().await?, page, subject_id).await
    }

    async fn capture_objects(&self, id: &str) -> Result<Vec<RenderedFile>, StoreError> {
        let mut conn = self.read().await?;
        captures::get(&mut conn, id).await?;
        capture_objects::list(&mut conn, id).await
    }

    async fn create_model(
        &self,
        new: NewModel,
        request: Option<RequestKey>,
    ) -> Result<Model, StoreError> {
        let mut tx = self.write().await?;
        let model = models::create(&mut tx, new, request, self.clock.now()).await?;
        commit(tx).await?;
        Ok(model)
    }

    async fn model(&self, id: &str) -> Result<Model, StoreError> {
        models::get(&mut *self.read().await?, id).await
    }

    async fn models(&self, page: Page) -> Result<Vec<Entry<Model>>, StoreError> {
        models::list(&mut *self.read().await?, page).await
    }

    async fn add_identity(
        &self,
        model_id: &str,
        subject_id: &str,
        request: Option<RequestKey>,
    ) -> Result<IdentitySlot, StoreError> {
        let mut tx = self.write().await?;
        let slot =
            models::add_identity(&mut tx, model_id, subject_id, request, self.clock.now()).await?;
        commit(tx).await?;
        Ok(slot)
    }

    async fn remove_identity(
        &self,
        model_id: &str,
        subject_id: &str,
        request: Option<RequestKey>,
    ) -> Result<Model, StoreError> {
        let mut tx = self.write().await?;
        let model =
            models::remove_identity(&mut tx, model_id, subject_id, request, self.clock.now())
                .await?;
        commit(tx).await?;
        Ok(model)
    }

    async fn checkpoints(&self, model_id: &str, limit: u32) -> Result<Vec<Checkpoint>, StoreError> {
        checkpoints::list(&mut *self.read().await?, model_id, limit).await
    }

    async fn kept_checkpoints(
        &self,
        model_id: &str,
        default: Retention,
    ) -> Result<Vec<Checkpoint>, StoreError> {
        checkpoints::explained(&mut *self.read().await?, model_id, default).await
    }

    async fn set_retention(
        &self,
        model_id: &str,
        retention: v1::Retention,
        default: Retention,
    ) -> Result<Model, StoreError> {
        let mut tx = self.write().await?;
        let model =
            models::set_retention(&mut tx, model_id, &retention, default, self.clock.now()).await?;
        commit(tx).await?;
        Ok(model)
    }

    async fn delete(
        &self,
        target: Target<'_>,
        etag: &str,
        request: Option<RequestKey>,
    ) -> Result<Deleted, StoreError> {
        let mut tx = self.write().await?;
        let deleted = deletion::delete(&mut tx, target, etag, request, self.clock.now()).await?;
        commit(tx).await?;
        Ok(deleted)
    }

    async fn garbage(&self) -> Result<Vec<KnownGarbage>, StoreError> {
        let now = self.keep_time().await?;
        garbage::known(&mut *self.read().await?, now).await
    }

    async fn references(
        &self,
        folders: &[String],
        keep_uploads: f64,
    ) -> Result<Vec<Reference>, StoreError> {
        let now = self.keep_time().await?;
        garbage::references(&mut *self.read().await?, folders, keep_uploads, now).await
    }

    async fn note_garbage(&self, new: &[String], gone: &[String]) -> Result<(), StoreError> {
        let mut tx = self.write().await?;
        garbage::note(&mut tx, new, gone, self.clock.now()).await?;
        commit(tx).await
    }

    async fn create_job(
        &self,
        new: NewJob,
        request: Option<RequestKey>,
    ) -> Result<Job, StoreError> {
        let mut tx = self.write().await?;
        let job = jobs::create(&mut tx, new, request, self.clock.now()).await?;
        commit(tx).await?;
        Ok(job)
    }

    async fn job(&self, id: &str) -> Result<Job, StoreError> {
        jobs::get(&mut *self.read().await?, id).await
    }

    async fn job_state(&self, id: &str) -> Result<Job, StoreError> {
        jobs::without_order(&mut *self.read().await?, id).await
    }

    async fn job_history(&self, id: &str) -> Result<Job, StoreError> {
        jobs::with_attempts(&mut *self.read().await?, id).await
    }

    async fn jobs(
        &self,
        page: Page,
        filter: &JobFilter,
        full: bool,
    ) -> Result<Vec<Entry<Job>>, StoreError> {
        jobs::list(&mut *self.read().await?, page, filter, full).await
    }

    async fn job_metrics(&self, id: &str) -> Result<JobMetrics, StoreError> {
        metrics::of_job(&mut *self.read().await?, id).await
    }

    async fn job_versions(&self, after: Option<i64>) -> Result<JobVersions, StoreError> {
        versions::list(&mut *self.read().await?, after).await
    }

    async fn outputs(&self, job_id: &str) -> Result<Vec<RenderedFile>, StoreError> {
        outputs::list(&mut *self.read().await?, job_id).await
    }

    async fn open_jobs(&self) -> Result<(u64, u64), StoreError> {
        jobs::open(&mut *self.read().await?).await
    }

    async fn cancel_job(&self, id: &str, request: Option<RequestKey>) -> Result<Job, StoreError> {
        let mut tx = self.write().await?;
        let job = jobs::cancel(&mut tx, id, request, self.clock.now()).await?;
        commit(tx).await?;
        Ok(job)
    }

    async fn pause_jobs(&self, kind: JobKind, reason: &str) -> Result<(), StoreError> {
        let mut tx = self.write().await?;
        pauses::pause(&mut tx, kind, reason, self.clock.now()).await?;
        commit(tx).await
    }

    async fn resume_jobs(&self, kind: JobKind) -> Result<(), StoreError> {
        let mut tx = self.write().await?;
        pauses::resume(&mut tx, kind).await?;
        commit(tx).await
    }

    async fn paused_kinds(&self) -> Result<Vec<PausedKind>, StoreError> {
        pauses::list(&mut *self.read().await?).await
    }

    async fn register_worker(&self, new: NewWorker) -> Result<String, StoreError> {
        let mut tx = self.write().await?;
        let id = workers::register(&mut tx, new, self.clock.now()).await?;
        commit(tx).await?;
        Ok(id)
    }

    async fn active_workers(
        &self,
        ids: &[&str],
        lease_seconds: f64,
    ) -> Result<Vec<WorkerStatus>, StoreError> {
        workers::active(&mut *self.read().await?, ids, lease_seconds).await
    }

    async fn workers(
        &self,
        page: Page,
        lease_seconds: f64,
    ) -> Result<Vec<Entry<WorkerStatus>>, StoreError> {
        workers::list(&mut *self.read().await?, page, lease_seconds).await
    }

    async fn lease_job(
        &self,
        worker_id: &str,
        request_id: &str,
        help: bool,
        lease_seconds: f64,
    ) -> Result<LeaseOutcome, StoreError> {
        let now = self.clock.now();
        let mut reader = self.read().await?;
        let work = leases::is_repeat(&mut reader, worker_id, request_id).await?
            || queue::any(&mut reader, worker_id, now).await?
            || help
                && queue::to_help(&mut reader, worker_id, None)
                    .await?
                    .is_some();
        if !work {
            return Ok(LeaseOutcome::default());
        }
        drop(reader);
        let mut tx = self.write().await?;
        let ask = leases::Ask {
            worker_id,
            request_id,
            help,
            lease_seconds,
            now: self.clock.now(),
        };
        let outcome = leases::lease(&mut tx, &ask).await?;
        commit(tx).await?;
        Ok(outcome)
    }

    async fn leased_spec(&self, lease: &LeaseKey) -> Result<JobSpec, StoreError> {
        leases::spec(&mut *self.read().await?, lease).await
    }

    async fn heartbeat(
        &self,
        lease: &LeaseKey,
        progress: Option<Progress>,
        lease_seconds: f64,
    ) -> Result<bool, StoreError> {
        let mut tx = self.write().await?;
        let deadline = self.clock.now() + lease_seconds;
        let cancel = leases::heartbeat(&mut tx, lease, progress, deadline).await?;
        commit(tx).await?;
        Ok(cancel)
    }

    async fn publish_checkpoint(
        &self,
        lease: &LeaseKey,
        checkpoint: Checkpoint,
        default: Retention,
    ) -> Result<(), StoreError> {
        let mut tx = self.write().await?;
        leases::publish(&mut tx, lease, checkpoint, default, self.clock.now()).await?;
        commit(tx).await
    }

    async fn commit_output(&self, lease: &LeaseKey, file: &RenderedFile) -> Result<(), StoreError> {
        let mut tx = self.write().await?;
        outputs::commit(&mut tx, lease, file).await?;
        commit(tx).await
    }

    async fn take_range(
        &self,
        lease: &LeaseKey,
        pictures: u32,
        drawn: Option<u32>,
    ) -> Result<TakenRange, StoreError> {
        let mut tx = self.write().await?;
        let (range, finished) = ranges::take(&mut tx, lease, pictures, drawn).await?;
        commit(tx).await?;
        ranges::taken(&mut *self.read().await?, &lease.job_id, range, finished).await
    }

    async fn end_job(&self, lease: &LeaseKey, ending: Ending) -> Result<(), StoreError> {
        let mut tx = self.write().await?;
        outcome::end(&mut tx, lease, ending, self.clock.now()).await?;
        commit(tx).await
    }

    async fn tick(&self, cap: u32, lease_seconds: f64) -> Result<Vec<Reaped>, StoreError> {
        let now = self.clock.now();
        if !reaping::is_due(&mut *self.read().await?, lease_seconds, now).await? {
            return Ok(Vec::new());
        }
        let mut tx = self.write().await?;
        let reaped = reaping::tick(&mut tx, cap, lease_seconds, self.clock.now()).await?;
        commit(tx).await?;
        Ok(reaped)
    }

    async fn take_back_embedded(&self, cap: u32) -> Result<Vec<Reaped>, StoreError> {
        let mut tx = self.write().await?;
        let reaped = reaping::take_back_embedded(&mut tx, cap, self.clock.now()).await?;
        commit(tx).await?;
        Ok(reaped)
    }

    async fn forget(&self, horizons: Horizons) -> Result<u64, StoreError> {
        let now = self.keep_time().await?;
        let mut tx = self.write().await?;
        let requests = requests::forget(&mut tx, horizons.request_ids, now).await?;
        let attempts = attempts::forget(&mut tx, horizons.attempts, now).await?;
        let workers = workers::forget(&mut tx, horizons.workers, now).await?;
        commit(tx).await?;
        Ok(requests + attempts + workers)
    }

    async fn keep_time(&self) -> Result<f64, StoreError> {
        steps::keep_time(self).await
    }

    async fn close(&self) {
        self.readers.close().await;
        self.writer.close().await;
    }
}
