//! Why the service in this process can't start or continue.

use std::net::SocketAddr;
use thiserror::Error;
use tokio::task::JoinError;
use yoto_server::{ServerError, TlsError};
use yoto_worker::WorkerError;

/// The reason why the embedded service can't start or continue.
#[derive(Debug, Error)]
pub enum EmbeddedError {
    /// The coordinator can't start or failed.
    #[error("the coordinator")]
    Server(#[from] ServerError),
    /// The certificate can't be used.
    #[error("the certificate")]
    Tls(#[from] TlsError),
    /// The worker can't start or was refused.
    #[error("the worker")]
    Worker(#[from] WorkerError),
    /// The address can't be opened for listening.
    #[error("listening at {address}")]
    Listen {
        /// The requested address.
        address: SocketAddr,
        /// The system's error.
        source: std::io::Error,
    },
    /// A part ended unexpectedly.
    #[error("the {0} ended unexpectedly")]
    Ended(&'static str),
    /// A part panicked.
    #[error("the {part} panicked")]
    Broken {
        /// Name of the part.
        part: &'static str,
        /// Message of the panic.
        source: JoinError,
    },
    /// A part did not end in time and was stopped by force.
    #[error("the {0} did not end in time and was stopped by force")]
    TimedOut(&'static str),
}
