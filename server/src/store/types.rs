//! What goes into the store and comes out of it, beside the contract's own messages.

use prost::Message;
use thiserror::Error;
use yoto_proto::v1::{JobError, JobSpec, WorkerDevice, job_spec};

/// A new id: unique, and in the alphabet that resource names allow.
pub fn new_id() -> String {
    uuid::Uuid::now_v7().to_string()
}

/// What went wrong in the store.
#[derive(Debug, Error)]
pub enum StoreError {
    /// The database did not do what it was asked to.
    #[error("{action}: {cause}")]
    Database {
        /// What was being done.
        action: &'static str,
        /// The driver's error.
        cause: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The database holds something that this program can't read.
    #[error("{what} is unreadable in the database: {detail}")]
    Corrupt {
        /// The column.
        what: &'static str,
        /// What is wrong with it.
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
    /// The request id was used before, for another body.
    #[error("request id '{request_id}' was used before with another body")]
    RequestIdReused {
        /// The id.
        request_id: String,
    },
    /// The fencing token is not the job's newest, or the job no longer runs.
    #[error("token {token} holds no lease on {job}: it was leased again, or it no longer runs")]
    StaleLease {
        /// The job's name.
        job: String,
        /// The token that was refused.
        token: u64,
    },
    /// The catalogue's present state forbids it.
    #[error("{message}")]
    Rule {
        /// Machine-readable.
        reason: &'static str,
        /// For people.
        message: String,
    },
}

/// Makes a repeated call recognisable: the caller's id, and what was asked.
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
    /// The key of `body`, which carries `request_id`; none when the caller gave no id.
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

/// Which part of a list is wanted.
#[derive(Debug, Clone, Copy)]
pub struct Page {
    /// At most so many entries.
    pub limit: u32,
    /// Go on behind this position; none starts at the beginning.
    pub after: Option<i64>,
}

/// An entry of a list with its position, which the next page starts behind.
#[derive(Debug, Clone)]
pub struct Entry<T> {
    /// Grows or falls along the list.
    pub position: i64,
    /// The entry.
    pub item: T,
}

/// A subject to create.
#[derive(Debug, Clone)]
pub struct NewSubject {
    /// For people.
    pub display_name: String,
    /// Under which consent the recordings are used.
    pub consent_note: String,
}

/// A model to create.
#[derive(Debug, Clone)]
pub struct NewModel {
    /// For people.
    pub display_name: String,
    /// One of [`yoto_proto::tiers::TIERS`].
    pub tier: String,
    /// One of [`yoto_proto::tiers::VARIANTS`].
    pub variant: String,
}

/// A worker that reports for work.
#[derive(Debug, Clone)]
pub struct NewWorker {
    /// For people.
    pub display_name: String,
    /// What it computes on.
    pub device: WorkerDevice,
    /// What it runs.
    pub kinds: Vec<JobKind>,
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

/// What a job does.
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
    /// As it stands in the database and in `RegisterWorkerRequest.kinds`.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Ingest => "ingest",
            Self::Train => "train",
            Self::Render => "render",
            Self::Evaluate => "evaluate",
        }
    }

    /// The kind called `name`.
    pub fn parse(name: &str) -> Option<Self> {
        [Self::Ingest, Self::Train, Self::Render, Self::Evaluate]
            .into_iter()
            .find(|kind| kind.as_str() == name)
    }

    /// The kind of `spec`, if it says one.
    pub fn of(spec: &JobSpec) -> Option<Self> {
        spec.kind.as_ref().map(|kind| match kind {
            job_spec::Kind::Ingest(_) => Self::Ingest,
            job_spec::Kind::Train(_) => Self::Train,
            job_spec::Kind::Render(_) => Self::Render,
            job_spec::Kind::Evaluate(_) => Self::Evaluate,
        })
    }
}

/// A claim on a job: every write of a worker is guarded by it.
#[derive(Debug, Clone)]
pub struct LeaseKey {
    /// The job's id.
    pub job_id: String,
    /// The fencing token.
    pub token: u64,
}

/// How a worker ends a job without a result.
#[derive(Debug, Clone)]
pub enum Ending {
    /// The job can't be done.
    Failed(JobError),
    /// The worker stopped because it was told to.
    Cancelled,
    /// The worker gives it back unharmed.
    Requeued,
    /// What the job needs failed, not the job: try again later, but not forever.
    TryLater(JobError),
}

/// What the reaper did with a job whose lease ran out.
#[derive(Debug, Clone)]
pub struct Reaped {
    /// `jobs/{id}`.
    pub job: String,
    /// `workers/{id}` that went silent.
    pub worker: String,
    /// Workers lost over this job, this one included.
    pub lost_workers: u32,
    /// The job's state now.
    pub state: yoto_proto::v1::job::State,
}
