//! Limits of what clients may use: connections, calls, and bytes of requests.
//!
//! ```text
//! connection ─► Traffic::admit ─► Admitted, with a Client ─► TrafficLayer ─► call, with an Incoming message ─► services
//! ```
//!
//! A call beyond a limit is refused at once as UNAVAILABLE, and clients retry: nobody waits for a stranger. Each
//! listener has its own counts, so clients on a network can't use up the limits of the workers in this process.
//!
//! tonic and tower cover only a part of this. Their concurrency limits and timeouts end when a response begins, their
//! connections have a maximum age but no idle timeout, and the decoder reserves memory by the announced length.

mod connection;
mod decoded;
mod incoming;
mod layer;

pub(crate) use layer::TrafficLayer;

use crate::config::TrafficLimits;
use std::sync::atomic::AtomicUsize;
use std::sync::{Arc, Mutex};
use tokio::sync::Semaphore;
use tokio::time::Instant;
use tonic::Request;
use yoto_request::RequestError;

/// What all clients of a listener use together.
#[derive(Debug)]
pub(crate) struct Traffic {
    limits: TrafficLimits,
    connections: Arc<Semaphore>,
    calls: Arc<Semaphore>,
    /// Bytes of requests that are left.
    bytes: Arc<Semaphore>,
}

/// What the client of one connection uses.
#[derive(Debug)]
pub(crate) struct Client {
    /// Whether it is in this process.
    in_process: bool,
    calls: AtomicUsize,
    /// When its last call ended; before its first call, when it connected.
    quiet_since: Mutex<Instant>,
    /// Bytes of requests that are left.
    bytes: Arc<Semaphore>,
}

impl Traffic {
    /// Counts with nothing in use.
    pub(crate) fn new(limits: &TrafficLimits) -> Arc<Self> {
        Arc::new(Self {
            limits: limits.clone(),
            connections: Arc::new(Semaphore::new(limits.connections)),
            calls: Arc::new(Semaphore::new(limits.calls)),
            bytes: Arc::new(Semaphore::new(limits.bytes as usize)),
        })
    }

    fn client(&self) -> Client {
        Client {
            in_process: false,
            calls: AtomicUsize::new(0),
            quiet_since: Mutex::new(Instant::now()),
            bytes: Arc::new(Semaphore::new(self.limits.connection_bytes as usize)),
        }
    }
}

impl Client {
    /// Whether the call `request` came through a pipe from this process.
    pub(crate) fn is_in_process<T>(request: &Request<T>) -> bool {
        let client = request.extensions().get::<Arc<Self>>();
        client.is_some_and(|it| it.in_process)
    }
}

/// The error of a call beyond a limit.
fn busy(message: impl Into<String>) -> RequestError {
    RequestError::Busy(message.into())
}
