//! The kinds of faults.

use serde::{Deserialize, Serialize};

/// A kind of fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fault {
    /// SIGKILL of a worker that runs a job.
    WorkerKilled,
    /// SIGKILL of the coordinator at any moment.
    CoordinatorKilled,
    /// End of the coordinator before a commit.
    EndBeforeCommit,
    /// End of the coordinator after a commit.
    EndAfterCommit,
    /// End of the coordinator between commit and answer.
    EndBeforeReply,
    /// SIGSTOP of a worker past its lease, then SIGCONT.
    WorkerStopped,
    /// A worker that can't reach the coordinator until after its lease, and continues.
    Partition,
    /// A job with a thread that hangs.
    JobHung,
    /// A call that arrives two or three times.
    CallRepeated,
    /// A copy of a call arrives after later calls.
    CallLate,
    /// A call that is carried out, and answered with UNAVAILABLE.
    AnswerLost,
    /// A hint of another coordinator that is lost.
    HintLost,
    /// The coordinator's clock is set an hour ahead.
    ClockForward,
    /// The coordinator's clock is set back by an hour.
    ClockBack,
    /// A job that ends each of its workers.
    Poison,
    /// An upload whose connection is cut.
    UploadCut,
    /// An object store that answers with errors.
    StoreError,
    /// An object store that answers late.
    StoreLate,
    /// An object store that breaks off in the middle of an object.
    StoreHalf,
    /// A worker that can't write files above a few kilobytes.
    DiskFull,
    /// A coordinator that can't write any file.
    DatabaseFull,
    /// A bit of a stored checkpoint is flipped.
    BitFlipped,
    /// A watcher that never reads.
    SilentWatcher,
    /// SIGKILL of a process that contains coordinator and workers.
    EmbeddedKilled,
    /// SIGSTOP of all processes of PostgreSQL past a lease, then SIGCONT.
    DatabaseStopped,
    /// A crash of PostgreSQL, and a start after a while.
    DatabaseCrashed,
    /// A coordinator that can't reach the database while another can.
    DatabaseCut,
    /// A worker that can't reach one of the coordinators.
    CoordinatorCut,
    /// An object store that answers 503 to everybody.
    StoreUnavailable,
    /// Connections without a key that ask nothing.
    Strangers,
    /// A key whose tenant takes every call that it can get.
    GreedyTenant,
    /// A key with downloads that nobody reads.
    SlowReaders,
}

/// What a service is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Makeup {
    /// Number of coordinators.
    pub coordinators: usize,
    /// PostgreSQL in place of SQLite.
    pub postgres: bool,
    /// S3 in place of a folder.
    pub s3: bool,
}

impl Makeup {
    /// A coordinator with SQLite and a folder.
    pub const SMALL: Self = Self {
        coordinators: 1,
        postgres: false,
        s3: false,
    };
}

impl Fault {
    /// All kinds, as the table lists them.
    pub const ALL: [Self; 32] = [
        Self::WorkerKilled,
        Self::CoordinatorKilled,
        Self::EndBeforeCommit,
        Self::EndAfterCommit,
        Self::EndBeforeReply,
        Self::WorkerStopped,
        Self::Partition,
        Self::JobHung,
        Self::CallRepeated,
        Self::CallLate,
        Self::AnswerLost,
        Self::HintLost,
        Self::ClockForward,
        Self::ClockBack,
        Self::Poison,
        Self::UploadCut,
        Self::StoreError,
        Self::StoreLate,
        Self::StoreHalf,
        Self::DiskFull,
        Self::DatabaseFull,
        Self::BitFlipped,
        Self::SilentWatcher,
        Self::EmbeddedKilled,
        Self::DatabaseStopped,
        Self::DatabaseCrashed,
        Self::DatabaseCut,
        Self::CoordinatorCut,
        Self::StoreUnavailable,
        Self::Strangers,
        Self::GreedyTenant,
        Self::SlowReaders,
    ];

    /// The kinds that a service of this makeup can have.
    pub fn kinds(makeup: Makeup) -> Vec<Self> {
        let Makeup {
            coordinators,
            postgres,
            s3,
        } = makeup;
        let mut kinds = Self::ALL.to_vec();
        kinds.retain(|kind| match kind {
            Self::DatabaseStopped | Self::DatabaseCrashed => postgres,
            Self::DatabaseCut | Self::HintLost => postgres && coordinators > 1,
            Self::CoordinatorCut => coordinators > 1,
            Self::StoreUnavailable => s3,
            // The limit of files is one of the process that writes them, and PostgreSQL has its own.
            Self::DatabaseFull => !postgres,
            // A service of its own, with SQLite and a folder.
            Self::EmbeddedKilled => makeup == Makeup::SMALL,
            _ => true,
        });
        kinds
    }

    /// The kinds that the smallest service can't have, and the ends of one of several coordinators.
    pub fn of_several(makeup: Makeup) -> Vec<Self> {
        let small = Self::kinds(Makeup::SMALL);
        let mut kinds = Self::kinds(makeup);
        let several = makeup.coordinators > 1;
        kinds.retain(|it| !small.contains(it) || (several && *it == Self::CoordinatorKilled));
        kinds
    }

    /// Its name in the table and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::WorkerKilled => "worker-killed",
            Self::CoordinatorKilled => "coordinator-killed",
            Self::EndBeforeCommit => "end-before-commit",
            Self::EndAfterCommit => "end-after-commit",
            Self::EndBeforeReply => "end-before-reply",
            Self::WorkerStopped => "worker-stopped",
            Self::Partition => "partition",
            Self::JobHung => "job-hung",
            Self::CallRepeated => "call-repeated",
            Self::CallLate => "call-late",
            Self::AnswerLost => "answer-lost",
            Self::HintLost => "hint-lost",
            Self::ClockForward => "clock-forward",
            Self::ClockBack => "clock-back",
            Self::Poison => "poison",
            Self::UploadCut => "upload-cut",
            Self::StoreError => "store-error",
            Self::StoreLate => "store-late",
            Self::StoreHalf => "store-half",
            Self::DiskFull => "disk-full",
            Self::DatabaseFull => "database-full",
            Self::BitFlipped => "bit-flipped",
            Self::SilentWatcher => "silent-watcher",
            Self::EmbeddedKilled => "embedded-killed",
            Self::DatabaseStopped => "database-stopped",
            Self::DatabaseCrashed => "database-crashed",
            Self::DatabaseCut => "database-cut",
            Self::CoordinatorCut => "coordinator-cut",
            Self::StoreUnavailable => "store-unavailable",
            Self::Strangers => "strangers",
            Self::GreedyTenant => "greedy-tenant",
            Self::SlowReaders => "slow-readers",
        }
    }

    /// The kind with this name.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|fault| fault.name() == name)
    }
}
