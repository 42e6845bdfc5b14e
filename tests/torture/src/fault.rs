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
}

impl Fault {
    /// All kinds, as the table lists them.
    pub const ALL: [Self; 23] = [
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
    ];

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
        }
    }

    /// The kind with this name.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|fault| fault.name() == name)
    }
}
