//! Input and output types of the store, besides the contract's messages.

use prost::Message;
use thiserror::Error;
use yoto_proto::{
    names::Collection,
    v1::{
        self, Inputs, Job, JobError, JobResult, JobSpec, WorkerDevice, job, job_attempt::Outcome,
        job_spec,
    },
};

/// A new id: unique, and in the alphabet that resource names allow.
pub fn new_id() -> String {
    uuid::Uuid::new_v4().to_string()
}

/// An error of the store.
#[derive(Debug, Error)]
pub enum StoreError {
    /// A failure of the database.
    #[error("{action}: {cause}")]
    Database {
        /// The failed action.
        action: &'static str,
        /// The driver's error.
        cause: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The database holds a value that this program can't read.
    #[error("{what} is unreadable in the database: {detail}")]
    Corrupt {
        /// The column.
        what: &'static str,
        /// The fault.
        detail: String,
    },
    /// No such resource.
    #[error("{name} does not exist")]
    NotFound {
        /// Its full name.
        name: String,
    },
    /// A number that the database can't hold.
    #[error("{field}: {value} is too large")]
    TooLarge {
        /// The field of the request.
        field: &'static str,
        /// Its value.
        value: u64,
    },
    /// The request id was used before with another body.
    #[error("request id '{request_id}' was used before with another body")]
    RequestIdReused {
        /// The id.
        request_id: String,
    },
    /// The fencing token is not the job's newest, or the job is no longer running.
    #[error(
        "token {token} has no lease on {job}: the job was leased again or is no longer running"
    )]
    StaleLease {
        /// The job's name.
        job: String,
        /// The token that was refused.
        token: u64,
    },
    /// Not possible in the catalogue's current state.
    #[error("{message}")]
    Rule {
        /// Machine-readable.
        reason: &'static str,
        /// Human-readable.
        message: String,
    },
}

/// Identifies a repeated call: the caller's id, and the request.
#[derive(Debug, Clone)]
pub struct RequestKey {
    /// The RPC; ids of different RPCs never collide.
    pub method: &'static str,
    /// The caller's id.
    pub request_id: String,
    /// SHA-256 of the encoded request.
    pub body_sha256: String,
}

impl RequestKey {
    /// The key of `body`, which has `request_id`; none without an id.
    pub fn new(method: &'static str, request_id: &str, body: &impl Message) -> Option<Self> {
        if request_id.is_empty() {
            return None;
        }
        let body_sha256 = yoto_proto::sha256_hex(&body.encode_to_vec());
        Some(Self {
            method,
            request_id: request_id.to_owned(),
            body_sha256,
        })
    }
}

/// A page of a list.
#[derive(Debug, Clone, Copy)]
pub struct Page {
    /// Largest number of entries.
    pub limit: u32,
    /// Continue after this position; none starts at the beginning.
    pub after: Option<i64>,
}

/// An entry of a list with its position, after which the next page starts.
#[derive(Debug, Clone)]
pub struct Entry<T> {
    /// Increases or decreases along the list.
    pub position: i64,
    /// The entry.
    pub item: T,
}

/// A subject to create.
#[derive(Debug, Clone)]
pub struct NewSubject {
    /// Human-readable.
    pub display_name: String,
    /// The consent under which the recordings are used.
    pub consent_note: String,
}

/// An upload to open.
#[derive(Debug, Clone)]
pub struct NewUpload {
    /// Whose capture it is.
    pub subject_id: String,
    /// Its files, none of which is there yet.
    pub files: Vec<UploadedFile>,
}

/// An upload, which is a capture as long as its files are written.
#[derive(Debug, Clone)]
pub struct Upload {
    /// The id of its capture.
    pub id: String,
    /// Whose capture it is.
    pub subject_id: String,
    /// Whether it may still be written.
    pub open: bool,
    /// When it was last written, seconds since 1970 on the database's clock.
    pub write_time: f64,
    /// Its files, by path.
    pub files: Vec<UploadFile>,
}

/// A file of an upload.
#[derive(Debug, Clone)]
pub struct UploadFile {
    /// Relative to the capture.
    pub path: String,
    /// Size once it is complete.
    pub bytes: u64,
    /// Checksum once it is complete, lower-case hex.
    pub sha256: String,
    /// Bytes from its beginning that are on disk for good.
    pub committed: u64,
}

/// Bytes of a file that are on disk, and follow what was committed of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CommittedPart {
    /// The file's path.
    pub path: String,
    /// First byte.
    pub from: u64,
    /// Byte after the last.
    pub to: u64,
}

/// A model to create.
#[derive(Debug, Clone)]
pub struct NewModel {
    /// Human-readable.
    pub display_name: String,
    /// One of [`yoto_proto::tiers::TIERS`].
    pub tier: String,
    /// One of [`yoto_proto::tiers::VARIANTS`].
    pub variant: String,
    /// Which checkpoints it keeps.
    pub retention: v1::Retention,
}

/// Something to delete, by id.
#[derive(Debug, Clone, Copy)]
pub enum Target<'a> {
    /// A person, with their captures.
    Subject(&'a str),
    /// A capture.
    Capture(&'a str),
    /// A model, with its checkpoints and jobs.
    Model(&'a str),
    /// A checkpoint.
    Checkpoint {
        /// Its model.
        model: &'a str,
        /// Its step.
        step: u64,
    },
    /// A job that has ended.
    Job(&'a str),
}

/// A folder of the object store that is known as garbage.
#[derive(Debug, Clone)]
pub struct KnownGarbage {
    /// Its key. If it was deleted, everything below is garbage as well.
    pub folder: String,
    /// Whether it belonged to something that was deleted.
    pub deleted: bool,
    /// Seconds since it was found.
    pub age: f64,
}

/// What refers to a folder of the object store.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reference {
    /// A row of the catalogue: its objects are in use.
    Row,
    /// A running job that may write to it.
    Lease,
    /// Nothing does, and nothing ever will again.
    Nothing,
}

/// A worker that registers.
#[derive(Debug, Clone)]
pub struct NewWorker {
    /// Human-readable.
    pub display_name: String,
    /// Its device.
    pub device: WorkerDevice,
    /// Kinds of jobs that it runs.
    pub kinds: Vec<JobKind>,
    /// Whether it runs in the coordinator's process.
    pub embedded: bool,
}

/// A file that was uploaded and written to the object store.
#[derive(Debug, Clone)]
pub struct UploadedFile {
    /// Relative to the capture.
    pub path: String,
    /// Size.
    pub bytes: u64,
    /// Lower-case hex.
    pub sha256: String,
}

/// Kind of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JobKind {
    /// Makes a training shard of a capture.
    Ingest,
    /// Trains a model.
    Train,
    /// Renders pictures.
    Render,
    /// Measures a model.
    Evaluate,
}

impl JobKind {
    /// The name in the database, and for people.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Ingest => "ingest",
            Self::Train => "train",
            Self::Render => "render",
            Self::Evaluate => "evaluate",
        }
    }

    /// The kind in a column of the database.
    pub fn of_column(name: &str) -> Result<Self, StoreError> {
        let kinds = [Self::Ingest, Self::Train, Self::Render, Self::Evaluate];
        let found = kinds.into_iter().find(|kind| kind.as_str() == name);
        found.ok_or_else(|| StoreError::Corrupt {
            what: "kind",
            detail: name.to_owned(),
        })
    }

    /// The contract's number.
    pub fn to_proto(self) -> v1::JobKind {
        match self {
            Self::Ingest => v1::JobKind::Ingest,
            Self::Train => v1::JobKind::Train,
            Self::Render => v1::JobKind::Render,
            Self::Evaluate => v1::JobKind::Evaluate,
        }
    }

    /// The kind with the contract's `number`, if that names one.
    pub fn of_proto(number: i32) -> Option<Self> {
        match v1::JobKind::try_from(number).ok()? {
            v1::JobKind::Ingest => Some(Self::Ingest),
            v1::JobKind::Train => Some(Self::Train),
            v1::JobKind::Render => Some(Self::Render),
            v1::JobKind::Evaluate => Some(Self::Evaluate),
            v1::JobKind::Unspecified => None,
        }
    }

    /// The kind of `spec`, if it has one.
    pub fn of(spec: &JobSpec) -> Option<Self> {
        spec.kind.as_ref().map(|kind| match kind {
            job_spec::Kind::Ingest(_) => Self::Ingest,
            job_spec::Kind::Train(_) => Self::Train,
            job_spec::Kind::Render(_) => Self::Render,
            job_spec::Kind::Evaluate(_) => Self::Evaluate,
        })
    }
}

/// A claim on a job, which guards every write of a worker.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LeaseKey {
    /// The job's id.
    pub job_id: String,
    /// The id of the worker that leased it.
    pub worker_id: String,
    /// The fencing token.
    pub token: u64,
}

impl LeaseKey {
    /// The token in the column's type. A token beyond the column's range was never issued.
    pub fn column(&self) -> Result<i64, StoreError> {
        i64::try_from(self.token).map_err(|_| self.stale())
    }

    /// The refusal of a claim that is not the job's newest.
    pub fn stale(&self) -> StoreError {
        StoreError::StaleLease {
            job: Collection::Jobs.name(&self.job_id),
            token: self.token,
        }
    }
}

/// A leased job, with all that its worker needs.
#[derive(Debug)]
pub struct LeasedJob {
    /// The job.
    pub job: Job,
    /// The fencing token.
    pub token: u64,
    /// Its inputs.
    pub inputs: Inputs,
}

/// What came of a worker's request for a job.
#[derive(Debug, Default)]
pub struct Turn {
    /// The leased job, if one waited.
    pub leased: Option<LeasedJob>,
    /// Jobs that FAILED instead, since their inputs can't be found, `jobs/{id}` with the reason.
    pub failed: Vec<(String, String)>,
}

/// A job to queue.
#[derive(Debug, Clone)]
pub struct NewJob {
    /// The order.
    pub spec: JobSpec,
    /// Whose turn it is: 0 (low) to 3 (urgent).
    pub priority: u8,
    /// For whom it runs.
    pub owner: String,
}

impl NewJob {
    /// Priority of a job that asks for none.
    pub const NORMAL: u8 = 1;

    /// An order of normal priority, for nobody in particular.
    pub fn normal(spec: JobSpec) -> Self {
        Self {
            spec,
            priority: Self::NORMAL,
            owner: String::new(),
        }
    }
}

/// Which jobs to list.
#[derive(Debug, Clone, Default)]
pub struct JobFilter {
    /// Their states; empty: all.
    pub states: Vec<job::State>,
    /// Their kinds; empty: all.
    pub kinds: Vec<JobKind>,
    /// The id of their model, if only one is asked for.
    pub model_id: Option<String>,
    /// Their owner, if only one is asked for.
    pub owner: Option<String>,
}

/// End of a lease.
#[derive(Debug, Clone)]
pub enum Ending {
    /// The job SUCCEEDED.
    Succeeded(JobResult),
    /// The job FAILED.
    Failed(JobError),
    /// The worker stopped on request.
    Cancelled,
    /// The worker returns the job without a fault.
    Returned,
    /// A resource of the job failed, not the job: retry later, a limited number of times.
    Postponed(JobError),
}

impl Ending {
    /// How the attempt's history calls it.
    pub fn outcome(&self) -> Outcome {
        match self {
            Self::Succeeded(_) => Outcome::Succeeded,
            Self::Failed(_) => Outcome::Failed,
            Self::Cancelled => Outcome::Cancelled,
            Self::Returned => Outcome::Returned,
            Self::Postponed(_) => Outcome::Postponed,
        }
    }
}

/// The reaper's action on a job with an expired lease.
#[derive(Debug, Clone)]
pub struct Reaped {
    /// `jobs/{id}`.
    pub job: String,
    /// The silent `workers/{id}`.
    pub worker: String,
    /// Workers lost over this job since its last checkpoint, this one included.
    pub losses: u32,
    /// The job's state now.
    pub state: job::State,
}

/// Ages at which rows are forgotten, seconds.
#[derive(Debug, Clone, Copy)]
pub struct Horizons {
    /// Answers to request ids.
    pub request_ids: f64,
    /// Ended attempts of jobs.
    pub attempts: f64,
    /// Workers that nothing names any more.
    pub workers: f64,
}
