//! Jobs and leases in the interface of the store.

use super::StoreError;
use crate::TraceParent;
use yoto_proto::names::Collection;
use yoto_proto::v1::job_attempt::Outcome;
use yoto_proto::v1::{
    self, Job, JobError, JobPriority, JobResult, JobSpec, RenderedFile, job, job_spec,
};
use yoto_proto::worker::v1::{Inputs, PictureRange};

/// Kind of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum JobKind {
    /// Makes a training shard of a capture.
    Ingest,
    /// Trains a model.
    Train,
    /// Renders pictures.
    Render,
    /// Measures a model.
    Evaluate,
    /// Writes a person to files.
    Export,
}

impl JobKind {
    /// All kinds.
    pub const ALL: [Self; 5] = [
        Self::Ingest,
        Self::Train,
        Self::Render,
        Self::Evaluate,
        Self::Export,
    ];

    /// The name in the database, and for people.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Ingest => "ingest",
            Self::Train => "train",
            Self::Render => "render",
            Self::Evaluate => "evaluate",
            Self::Export => "export",
        }
    }

    /// The kind in a column of the database.
    pub fn of_column(name: &str) -> Result<Self, StoreError> {
        let found = Self::ALL.into_iter().find(|kind| kind.as_str() == name);
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
            Self::Export => v1::JobKind::Export,
        }
    }

    /// The kind with the contract's `number`, if that names one.
    pub fn of_proto(number: i32) -> Option<Self> {
        match v1::JobKind::try_from(number).ok()? {
            v1::JobKind::Ingest => Some(Self::Ingest),
            v1::JobKind::Train => Some(Self::Train),
            v1::JobKind::Render => Some(Self::Render),
            v1::JobKind::Evaluate => Some(Self::Evaluate),
            v1::JobKind::Export => Some(Self::Export),
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
            job_spec::Kind::Export(_) => Self::Export,
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

    /// The refusal of a claim that is not the job's current one.
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
    /// Whether another worker runs it.
    pub helps: bool,
}

/// The pictures that a lease of a render draws next.
#[derive(Debug, Clone, PartialEq)]
pub struct TakenRange {
    /// Its pictures; `None` if other leases have the rest, or nothing is left.
    pub range: Option<PictureRange>,
    /// The committed files of the range; of a finished render, all of its files.
    pub outputs: Vec<RenderedFile>,
    /// Number of files that the render has committed.
    pub committed: u32,
    /// Whether all pictures are drawn.
    pub finished: bool,
}

/// The answer to a worker's request for a job.
#[derive(Debug, Default)]
pub struct LeaseOutcome {
    /// The leased job; `None` if no job was waiting.
    pub leased: Option<LeasedJob>,
    /// Jobs that FAILED instead, since their inputs can't be found, `jobs/{id}` with the reason.
    pub failed: Vec<(String, String)>,
}

/// A job to queue.
#[derive(Debug, Clone)]
pub struct NewJob {
    /// The order.
    pub spec: JobSpec,
    /// Priority in the queue: 0 (low) to 3 (urgent).
    pub priority: u8,
    /// Owner of the job, for a fair order of the queue; may be empty.
    pub owner: String,
    /// The caller's span, if it has told.
    pub trace_parent: Option<TraceParent>,
}

impl NewJob {
    /// Priority of a job that asks for none.
    pub const NORMAL: u8 = 1;

    /// The column of a priority.
    pub fn column(priority: JobPriority) -> u8 {
        match priority {
            JobPriority::Low => 0,
            JobPriority::Unspecified | JobPriority::Normal => Self::NORMAL,
            JobPriority::High => 2,
            JobPriority::Urgent => 3,
        }
    }

    /// An order of normal priority without an owner.
    pub fn normal(spec: JobSpec) -> Self {
        Self {
            spec,
            priority: Self::NORMAL,
            owner: String::new(),
            trace_parent: None,
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

/// The jobs to look at for changes.
#[derive(Debug, Default)]
pub struct JobVersions {
    /// Position of the newest job of all; 0: there is none.
    pub newest: i64,
    /// Open jobs, and the last ones of whatever state.
    pub jobs: Vec<JobVersion>,
}

/// A job by which a watcher finds whether it has changed.
#[derive(Debug)]
pub struct JobVersion {
    /// Its id.
    pub id: String,
    /// Its sequence number.
    pub sequence: u64,
    /// Whether it is QUEUED or RUNNING.
    pub is_open: bool,
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
    /// The outcome in the history of attempts.
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

/// A job that has ended for want of consent.
#[derive(Debug, Clone)]
pub struct StoppedJob {
    /// `jobs/{id}`.
    pub job: String,
    /// The person and the purpose, for people.
    pub reason: String,
}

/// A job that has ended, of whatever tenant.
#[derive(Debug, Clone)]
pub struct EndedJob {
    /// The job with its attempts, without its order.
    pub job: Job,
    /// The id of its tenant.
    pub tenant: String,
    /// The request id of the call that queued it, if the caller gave one and it is still kept.
    pub request_id: Option<String>,
    /// The span of the call that queued it, if the caller has told.
    pub trace_parent: Option<TraceParent>,
}

/// The open jobs of a kind, of all tenants.
#[derive(Debug, Clone, Copy)]
pub struct OpenJobs {
    /// Their kind.
    pub kind: JobKind,
    /// Number of QUEUED jobs.
    pub queued: u64,
    /// Number of RUNNING jobs.
    pub running: u64,
    /// Age of the oldest QUEUED job, seconds; 0 without any.
    pub oldest_seconds: f64,
}

/// The queue at a glance, for an operator.
#[derive(Debug, Clone)]
pub struct QueueFigures {
    /// Of each kind.
    pub open: Vec<OpenJobs>,
    /// Number of active workers.
    pub workers: u64,
}
