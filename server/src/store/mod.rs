//! The coordinator's memory: the catalogue and the job queue.
//!
//! One trait, so that the rules are independent of the database. Each method is one transaction.
//! Ids are bare (`{id}`), since callers have parsed the names.

mod sqlite;
mod types;

pub use sqlite::SqliteStore;
pub use types::{
    CommittedPart, Ending, Entry, JobKind, KnownGarbage, LeaseKey, NewModel, NewSubject, NewUpload,
    NewWorker, Page, Reaped, Reference, RequestKey, StoreError, Target, Upload, UploadFile,
    UploadedFile, new_id,
};

use crate::checkpoints::retention::Retention;
use async_trait::async_trait;
use yoto_proto::v1::{
    self, Capture, Checkpoint, Deleted, IdentitySlot, Job, JobResult, JobSpec, Model, Progress,
    Subject, SubjectShard, WorkerStatus, job,
};

/// The catalogue and the job queue. Every method fails with [`StoreError::Database`] when
/// the database does.
#[async_trait]
pub trait Store: Send + Sync + 'static {
    /// Creates a subject, or repeats the earlier answer to `request`.
    async fn create_subject(
        &self,
        new: NewSubject,
        request: Option<RequestKey>,
    ) -> Result<Subject, StoreError>;
    /// A subject by id.
    async fn subject(&self, id: &str) -> Result<Subject, StoreError>;
    /// Subjects, oldest first.
    async fn subjects(&self, page: Page) -> Result<Vec<Entry<Subject>>, StoreError>;
    /// The shard of the subject's newest READY capture.
    async fn shard(&self, subject_id: &str) -> Result<Option<SubjectShard>, StoreError>;

    /// Opens an upload: a capture in state UPLOADING, with its files. Returns its id, or that of the
    /// upload that `request` opened before.
    async fn create_upload(
        &self,
        new: NewUpload,
        request: Option<RequestKey>,
    ) -> Result<String, StoreError>;
    /// An upload by id, finished or not.
    async fn upload(&self, id: &str) -> Result<Upload, StoreError>;
    /// Records parts of an open upload that are on disk: all of them, or none.
    async fn commit_parts(&self, id: &str, parts: &[CommittedPart]) -> Result<(), StoreError>;
    /// Forgets the bytes of a file of an open upload.
    async fn restart_file(&self, id: &str, path: &str) -> Result<(), StoreError>;
    /// Ends a complete upload: the capture is INGESTING and its ingest job QUEUED, or neither. One that
    /// has ended is not changed.
    async fn finish_upload(
        &self,
        id: &str,
        request: Option<RequestKey>,
    ) -> Result<Capture, StoreError>;
    /// Ends the open uploads without a write for so long, and notes their objects as garbage. Returns
    /// their ids.
    async fn expire_uploads(&self, idle_seconds: f64) -> Result<Vec<String>, StoreError>;
    /// Queues another ingest job of a capture that is UPLOADED or REJECTED.
    async fn ingest_capture(
        &self,
        id: &str,
        request: Option<RequestKey>,
    ) -> Result<Capture, StoreError>;
    /// What was answered to `request` before: an id, in most cases.
    async fn answered(&self, request: Option<&RequestKey>) -> Result<Option<String>, StoreError>;
    /// A capture by id.
    async fn capture(&self, id: &str) -> Result<Capture, StoreError>;
    /// The files of a capture, by path.
    async fn capture_files(&self, id: &str) -> Result<Vec<UploadedFile>, StoreError>;

    /// Creates a model, or repeats the earlier answer to `request`.
    async fn create_model(
        &self,
        new: NewModel,
        request: Option<RequestKey>,
    ) -> Result<Model, StoreError>;
    /// A model by id, with its slots.
    async fn model(&self, id: &str) -> Result<Model, StoreError>;
    /// Models, oldest first.
    async fn models(&self, page: Page) -> Result<Vec<Entry<Model>>, StoreError>;
    /// Gives a READY subject the next slot, or returns its existing slot.
    async fn add_identity(
        &self,
        model_id: &str,
        subject_id: &str,
        request: Option<RequestKey>,
    ) -> Result<IdentitySlot, StoreError>;
    /// Takes a subject's slot away, which no checkpoint knows yet.
    async fn remove_identity(
        &self,
        model_id: &str,
        subject_id: &str,
        request: Option<RequestKey>,
    ) -> Result<Model, StoreError>;
    /// Checkpoints of a model, newest first, at most `limit`.
    async fn checkpoints(&self, model_id: &str, limit: u32) -> Result<Vec<Checkpoint>, StoreError>;
    /// All checkpoints of a model, newest first, with the reasons for which they are kept.
    async fn kept_checkpoints(
        &self,
        model_id: &str,
        default: Retention,
    ) -> Result<Vec<Checkpoint>, StoreError>;
    /// Changes which checkpoints a model keeps, and removes the others in the same transaction.
    async fn set_retention(
        &self,
        model_id: &str,
        retention: v1::Retention,
        default: Retention,
    ) -> Result<Model, StoreError>;

    /// Deletes the rows of something that no open job uses, and notes its objects as garbage, in one
    /// transaction; or repeats the earlier answer to `request`.
    async fn delete(
        &self,
        target: Target<'_>,
        request: Option<RequestKey>,
    ) -> Result<Deleted, StoreError>;
    /// The folders that are known as garbage.
    async fn garbage(&self) -> Result<Vec<KnownGarbage>, StoreError>;
    /// What refers to each of these folders of the object store.
    async fn references(&self, folders: &[String]) -> Result<Vec<Reference>, StoreError>;
    /// Notes the `new` folders as garbage from now on, and forgets the `gone` ones.
    async fn note_garbage(&self, new: &[String], gone: &[String]) -> Result<(), StoreError>;

    /// Queues a job, or repeats the earlier answer to `request`.
    async fn create_job(
        &self,
        spec: JobSpec,
        request: Option<RequestKey>,
    ) -> Result<Job, StoreError>;
    /// A job by id.
    async fn job(&self, id: &str) -> Result<Job, StoreError>;
    /// Jobs in one of `states`, or all, newest first.
    async fn jobs(&self, page: Page, states: &[job::State]) -> Result<Vec<Entry<Job>>, StoreError>;
    /// Step of the checkpoint that a render or evaluate job uses.
    async fn pinned_step(&self, job_id: &str) -> Result<Option<u64>, StoreError>;
    /// Numbers of QUEUED and RUNNING jobs.
    async fn open_jobs(&self) -> Result<(u64, u64), StoreError>;
    /// Ends a QUEUED job, marks a RUNNING one to be ended; an ended job is not changed.
    async fn cancel_job(&self, id: &str) -> Result<Job, StoreError>;

    /// Adds a worker. Returns its id.
    async fn register_worker(&self, new: NewWorker) -> Result<String, StoreError>;
    /// The workers with `ids`, and those with a RUNNING job, which they last reported on that long
    /// before its lease of `lease_seconds` ends.
    async fn workers(
        &self,
        ids: &[&str],
        lease_seconds: f64,
    ) -> Result<Vec<WorkerStatus>, StoreError>;
    /// Leases the oldest QUEUED job that the worker can run, for this many seconds.
    async fn lease_job(
        &self,
        worker_id: &str,
        lease_seconds: f64,
    ) -> Result<Option<Job>, StoreError>;
    /// Extends a lease and records progress. Returns whether the job is to be cancelled.
    async fn heartbeat(
        &self,
        lease: &LeaseKey,
        progress: Option<Progress>,
        lease_seconds: f64,
    ) -> Result<bool, StoreError>;
    /// Puts a checkpoint of the leased train job's model into the catalogue, and removes those that the
    /// model no longer keeps. A repeated call changes nothing, even after the checkpoint was removed.
    async fn publish_checkpoint(
        &self,
        lease: &LeaseKey,
        checkpoint: Checkpoint,
        default: Retention,
    ) -> Result<(), StoreError>;
    /// Ends a leased job with its result. In the same transaction, an ingest job's capture becomes
    /// READY, and a measured trade-off is stored with its checkpoint.
    async fn complete_job(&self, lease: &LeaseKey, result: JobResult) -> Result<(), StoreError>;
    /// Ends or requeues a leased job. The capture of an ingest job that ends becomes REJECTED if its files
    /// are at fault, and UPLOADED otherwise.
    async fn end_job(&self, lease: &LeaseKey, ending: Ending) -> Result<(), StoreError>;
    /// Takes back jobs with expired leases; a job that lost `cap` workers FAILS.
    async fn reap(&self, cap: u32) -> Result<Vec<Reaped>, StoreError>;

    /// Waits for running statements and closes the database.
    async fn close(&self);
}
