//! How much of the service its clients may hold: connections, calls, and bytes of messages on their way in.
//!
//! ```text
//! connection ─► Traffic::admit ─► Admitted, with a Client ─► TrafficLayer ─► call, with an Incoming message ─► services
//! ```
//!
//! What is beyond a limit is refused at once, as UNAVAILABLE: nothing waits for what a stranger holds, and clients
//! come again. Each listener counts for itself, so strangers on a network can't take the place of the workers in
//! this process.

mod connection;
mod incoming;
mod layer;
mod limits;

pub use layer::TrafficLayer;
pub use limits::TrafficLimits;

use crate::error::RequestError;
use std::sync::atomic::AtomicUsize;
use std::sync::{Arc, Mutex};
use std::time::Instant;
use tokio::sync::Semaphore;

/// What all clients of a listener hold together.
#[derive(Debug)]
pub struct Traffic {
    limits: TrafficLimits,
    connections: Arc<Semaphore>,
    calls: Arc<Semaphore>,
    /// Bytes of messages.
    bytes: Arc<Semaphore>,
}

/// What the client of one connection holds.
#[derive(Debug)]
pub struct Client {
    calls: AtomicUsize,
    /// When the last of its calls ended; at first, when it was connected.
    quiet_since: Mutex<Instant>,
    /// Bytes of messages.
    bytes: Arc<Semaphore>,
}

impl Traffic {
    /// Nobody holds anything.
    pub fn new(limits: &TrafficLimits) -> Arc<Self> {
        Arc::new(Self {
            limits: limits.clone(),
            connections: Arc::new(Semaphore::new(limits.connections)),
            calls: Arc::new(Semaphore::new(limits.calls)),
            bytes: Arc::new(Semaphore::new(limits.bytes as usize)),
        })
    }

    fn client(&self) -> Client {
        Client {
            calls: AtomicUsize::new(0),
            quiet_since: Mutex::new(Instant::now()),
            bytes: Arc::new(Semaphore::new(self.limits.connection_bytes as usize)),
        }
    }
}

/// The refusal of what is beyond a limit.
fn busy(message: impl Into<String>) -> RequestError {
    RequestError::Busy(message.into())
}
