//! What ends a worker.

use std::path::PathBuf;
use thiserror::Error;
use tonic::Status;
use yoto_objects::ObjectsError;

/// The reason why a worker can't start or continue.
#[derive(Debug, Error)]
pub enum WorkerError {
    /// The object store can't be used.
    #[error(transparent)]
    Objects(#[from] ObjectsError),
    /// The coordinator refuses this worker.
    #[error("the coordinator refuses this worker: {} [{:?}]", .0.message(), .0.code())]
    Refused(Box<Status>),
    /// The coordinator has no such service for workers.
    #[error(
        "the service at this address does not speak with workers of version {}: use the service's own version of yoto, \
         and check the address ({told})",
        env!("CARGO_PKG_VERSION")
    )]
    Protocol {
        /// The answer.
        told: String,
    },
    /// No coordinator has answered for the longest time that this worker may be idle.
    #[error("no coordinator of the service has answered for {seconds} s: {told}")]
    Unreachable {
        /// The time.
        seconds: u64,
        /// The last fault.
        told: String,
    },
    /// A job hangs in a thread that nothing can end. Its lease is not renewed, so another worker gets it;
    /// this process has to end.
    #[error(
        "{job} has shown no sign of life for {seconds} s: this worker ends, so that it runs elsewhere"
    )]
    Hung {
        /// `jobs/{id}`.
        job: String,
        /// Length of the silence.
        seconds: u64,
    },
    /// The folder for the files of jobs can not be made.
    #[error("the scratch folder {}", folder.display())]
    Scratch {
        /// The folder.
        folder: PathBuf,
        /// Why it can't be used.
        source: std::io::Error,
    },
    /// The process that reads uploads is not confined, and has to be.
    #[error("--require-confinement: {told}; a later kernel has both, or leave the option out")]
    Unconfined {
        /// What it can use.
        told: String,
    },
    /// The kernel has what confines that process, and refuses it.
    #[error("the process that reads uploads can't be confined: {told}")]
    Confinement {
        /// The fault.
        told: String,
    },
    /// A pause in the configuration is invalid.
    #[error("{field} is {value}: not a number of seconds")]
    Config {
        /// The setting.
        field: &'static str,
        /// Its value.
        value: f64,
    },
}
