//! The coordinator's memory: the catalogue and the job queue.
//!
//! One trait, so that the rules are independent of the database. Each method is one transaction.
//! Ids are bare (`{id}`), since callers have parsed the names.

mod job_types;
mod sqlite;
mod types;

pub use job_types::{
    Ending, JobFilter, JobKind, JobVersions, LeaseKey, LeaseOutcome, LeasedJob, NewJob, Reaped,
    TakenRange,
};
pub use sqlite::SqliteStore;
pub use types::{
    CommittedPart, Entry, Horizons, KnownGarbage, NewModel, NewSubject, NewUpload, NewWorker, Page,
    Reference, RequestKey, StoreError, SubjectChange, Target, Upload, UploadFile, UploadedFile,
    new_id,
};

use crate::checkpoints::retention::Retention;
use async_trait::async_trait;
use yoto_proto::v1::{
    self, Capture, Checkpoint, Deleted, IdentitySlot, Job, JobMetrics, JobSpec, Model, PausedKind,
    Progress, RenderedFile, Subject, WorkerStatus,
};
use yoto_proto::worker::v1::SubjectShard;

/// The catalogue and the job queue. If the database fails, each method returns [`StoreError::Unavailable`],
/// [`StoreError::Conflict`] or [`StoreError::Database`], depending on what a caller can do.
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
    /// Changes a subject, if its version is `etag` (empty: any).
    async fn update_subject(
        &self,
        id: &str,
        change: SubjectChange,
        etag: &str,
    ) -> Result<Subject, StoreError>;
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
    /// Ends the open uploads without a write for `idle_seconds`, and notes their objects as garbage. Returns
    /// their ids.
    async fn expire_uploads(&self, idle_seconds: f64) -> Result<Vec<String>, StoreError>;
    /// Queues another ingest job of a capture that is UPLOADED or REJECTED.
    async fn ingest_capture(
        &self,
        id: &str,
        request: Option<RequestKey>,
    ) -> Result<Capture, StoreError>;
    /// The stored answer to `request`, in most cases an id.
    async fn answered(&self, request: Option<&RequestKey>) -> Result<Option<String>, StoreError>;
    /// The files of a capture, by path.
    async fn capture_files(&self, id: &str) -> Result<Vec<UploadedFile>, StoreError>;
    /// A capture by id.
    async fn capture(&self, id: &str) -> Result<Capture, StoreError>;

    /// Captures of a person, or of all people, oldest first.
    async fn captures(
        &self,
        page: Page,
        subject_id: Option<&str>,
    ) -> Result<Vec<Entry<Capture>>, StoreError>;
    /// What the ingest job of a capture made for people: the check's report and a thumbnail.
    async fn capture_objects(&self, id: &str) -> Result<Vec<RenderedFile>, StoreError>;

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
    /// Removes a subject's slot that no checkpoint was trained with.
    async fn remove_identity(
        &self,
        model_id: &str,
        subject_id: &str,
        request: Option<RequestKey>,
    ) -> Result<Model, StoreError>;
    /// Checkpoints of a model, newest first, at most `limit`.
    async fn checkpoints(&self, model_id: &str, limit: u32) -> Result<Vec<Checkpoint>, StoreError>;
    /// All checkpoints of a model, newest first, with the reasons to keep each.
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

    /// Deletes the rows of a resource that no open job uses, and notes its objects as garbage, in one
    /// transaction. A repeated `request` gets its first answer.
    async fn delete(
        &self,
        target: Target<'_>,
        etag: &str,
        request: Option<RequestKey>,
    ) -> Result<Deleted, StoreError>;
    /// The folders that were noted as garbage.
    async fn garbage(&self) -> Result<Vec<KnownGarbage>, StoreError>;
    /// What refers to each of these folders of the object store.
    async fn references(
        &self,
        folders: &[String],
        keep_uploads: f64,
    ) -> Result<Vec<Reference>, StoreError>;
    /// Notes the `new` folders as garbage, and deletes the notes of the `gone` ones.
    async fn note_garbage(&self, new: &[String], gone: &[String]) -> Result<(), StoreError>;

    /// Queues a job, or repeats the earlier answer to `request`.
    async fn create_job(&self, new: NewJob, request: Option<RequestKey>)
    -> Result<Job, StoreError>;
    /// A job by id.
    async fn job(&self, id: &str) -> Result<Job, StoreError>;
    /// A job by id, without its order, which may be long and never changes.
    async fn job_state(&self, id: &str) -> Result<Job, StoreError>;
    /// A job by id, with its attempts.
    async fn job_history(&self, id: &str) -> Result<Job, StoreError>;
    /// Jobs that match the filter, newest first; with their orders if `full`.
    async fn jobs(
        &self,
        page: Page,
        filter: &JobFilter,
        full: bool,
    ) -> Result<Vec<Entry<Job>>, StoreError>;
    /// The figures of a job over its steps.
    async fn job_metrics(&self, id: &str) -> Result<JobMetrics, StoreError>;
    /// The open jobs, and all jobs after the position `after`, with the position of the newest job of all. Without `after`,
    /// only the open jobs.
    async fn job_versions(&self, after: Option<i64>) -> Result<JobVersions, StoreError>;
    /// The files that a render has committed so far.
    async fn outputs(&self, job_id: &str) -> Result<Vec<RenderedFile>, StoreError>;
    /// Numbers of QUEUED and RUNNING jobs.
    async fn open_jobs(&self) -> Result<(u64, u64), StoreError>;
    /// Ends a QUEUED job and marks a RUNNING one for cancellation; an ended job is not changed. A repeated call
    /// changes nothing.
    async fn cancel_job(&self, id: &str, request: Option<RequestKey>) -> Result<Job, StoreError>;
    /// Stops leasing jobs of a kind, for a reason.
    async fn pause_jobs(&self, kind: JobKind, reason: &str) -> Result<(), StoreError>;
    /// Leases jobs of a kind again.
    async fn resume_jobs(&self, kind: JobKind) -> Result<(), StoreError>;
    /// Kinds of jobs that are not leased.
    async fn paused_kinds(&self) -> Result<Vec<PausedKind>, StoreError>;

    /// Adds a worker. Returns its id.
    async fn register_worker(&self, new: NewWorker) -> Result<String, StoreError>;
    /// The workers with `ids`, and those with a RUNNING job. The time of their last report is `lease_seconds`
    /// before the deadline of the lease.
    async fn active_workers(
        &self,
        ids: &[&str],
        lease_seconds: f64,
    ) -> Result<Vec<WorkerStatus>, StoreError>;
    /// All workers, newest first.
    async fn workers(
        &self,
        page: Page,
        lease_seconds: f64,
    ) -> Result<Vec<Entry<WorkerStatus>>, StoreError>;
    /// Leases the first queued job that the worker may run, with its inputs, or, if `help` is set, a part of a
    /// running render. A repeated `request_id` gets the same lease again while it lasts.
    async fn lease_job(
        &self,
        worker_id: &str,
        request_id: &str,
        help: bool,
        lease_seconds: f64,
    ) -> Result<LeaseOutcome, StoreError>;
    /// The order of a leased job.
    async fn leased_spec(&self, lease: &LeaseKey) -> Result<JobSpec, StoreError>;
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
    /// Commits a file of the leased render or export, which replaces an earlier one of the same name.
    async fn commit_output(&self, lease: &LeaseKey, file: &RenderedFile) -> Result<(), StoreError>;
    /// Assigns the next range of a render with `pictures` pictures to the lease, and marks the range that
    /// begins at `drawn` as drawn. A repeated call returns the same range.
    async fn take_range(
        &self,
        lease: &LeaseKey,
        pictures: u32,
        drawn: Option<u32>,
    ) -> Result<TakenRange, StoreError>;
    /// Ends a lease, and the job with it unless the lease is a helper's. In the same transaction, the capture
    /// of an ingest job becomes READY, or REJECTED if its files are at fault, or else UPLOADED, and a measured
    /// trade-off is stored with its checkpoint. A repeated call changes nothing.
    async fn end_job(&self, lease: &LeaseKey, ending: Ending) -> Result<(), StoreError>;
    /// Extends all deadlines by an outage since the last call, then takes back jobs with expired leases. A job
    /// that lost `cap` workers without a checkpoint in between FAILS.
    async fn tick(&self, cap: u32, lease_seconds: f64) -> Result<Vec<Reaped>, StoreError>;
    /// Takes back the jobs of workers that ran in an earlier process of the coordinator.
    async fn take_back_embedded(&self, cap: u32) -> Result<Vec<Reaped>, StoreError>;
    /// Deletes rows that are older than their horizon. Returns the number of rows.
    async fn forget(&self, horizons: Horizons) -> Result<u64, StoreError>;

    /// Records the time, and a step of the clock since the last call, so that ages of rows count only running time.
    /// Returns the time. The health check calls it to find whether writes succeed.
    async fn keep_time(&self) -> Result<f64, StoreError>;
    /// Waits for running statements and closes the database.
    async fn close(&self);
}
