//! Limits of what clients may use: connections, calls, and bytes of requests.
//!
//! ```text
//! connection ─► Traffic::admit ─► Admitted, with a Client ─► TrafficLayer ─► Call, with an Incoming message ─► access ─► services
//!                    └─ waiting: those without an admitted call give way       └─ its places in the pools of its kind, once it is
//!                                                                                 known who makes it
//! ```
//!
//! A call beyond a limit is refused at once as UNAVAILABLE, and clients retry: nobody waits for a stranger. Each
//! listener has its own counts, so clients on a network can't use up the limits of the workers in this process. Within a
//! listener, each caller has a share ([`Pool`]).
//!
//! tonic and tower cover only a part of this. Their concurrency limits and timeouts end when a response begins, their
//! connections have a maximum age but no idle timeout, and the decoder reserves memory by the announced length.

mod call;
mod connection;
mod decoded;
mod held;
mod incoming;
mod layer;
mod waiting;

pub(crate) use call::Call;
pub(crate) use layer::TrafficLayer;

use crate::capacity::{NoPlace, Owner, Places, Pool};
use crate::config::TrafficLimits;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::Semaphore;
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;
use tonic::Request;
use waiting::Waiting;
use yoto_request::RequestError;

/// What all clients of a listener use together.
#[derive(Debug)]
pub(crate) struct Traffic {
    limits: TrafficLimits,
    calls: Arc<Semaphore>,
    pools: Pools,
    waiting: Waiting,
}

/// What has owners.
#[derive(Debug)]
struct Pools {
    connections: Arc<Pool>,
    waiting_connections: Arc<Pool>,
    user_calls: Arc<Pool>,
    worker_calls: Arc<Pool>,
    operator_calls: Arc<Pool>,
    open_calls: Arc<Pool>,
    downloads: Arc<Pool>,
    /// Bytes of requests.
    bytes: Arc<Pool>,
}

impl Pools {
    fn new(limits: &TrafficLimits) -> Self {
        Self {
            connections: Pool::new("connections", limits.connections),
            waiting_connections: Pool::new(
                "connections without an admitted call",
                limits.waiting_connections,
            ),
            user_calls: Pool::new("open calls", limits.user_calls),
            worker_calls: Pool::new("open calls of workers", limits.worker_calls),
            operator_calls: Pool::new("open calls of operators", limits.operator_calls),
            open_calls: Pool::new("open calls without a key", limits.open_calls),
            downloads: Pool::new("open downloads", limits.downloads),
            bytes: Pool::new("bytes of requests", limits.bytes as usize),
        }
    }
}

/// What the client of one connection uses.
#[derive(Debug)]
pub(crate) struct Client {
    /// Whether it is in this process.
    in_process: bool,
    /// Its address, if the waiting connections of an address have a share.
    owner: Option<Owner>,
    /// Its place among the waiting connections, or among those of callers once a call was admitted. A client that gives way has none.
    place: Mutex<Option<Places>>,
    /// Whether a call on this connection was admitted.
    admitted: AtomicBool,
    /// Ends the connection, which has to give way.
    gives_way: CancellationToken,
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
            calls: Arc::new(Semaphore::new(limits.calls)),
            pools: Pools::new(limits),
            waiting: Waiting::default(),
            limits: limits.clone(),
        })
    }

    fn client(&self, owner: Option<Owner>, place: Places, in_process: bool) -> Client {
        Client {
            in_process,
            owner,
            place: Mutex::new(Some(place)),
            admitted: AtomicBool::new(false),
            gives_way: CancellationToken::new(),
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

    /// Notes that a call was admitted: the connection is no stranger's any more, and counts for the caller.
    ///
    /// # Errors
    /// When the caller has its share of connections already.
    fn admitted(&self, pool: &Arc<Pool>, owners: &[Owner]) -> Result<(), NoPlace> {
        let mut place = self.place.lock().unwrap_or_else(PoisonError::into_inner);
        if !self.was_admitted() {
            *place = Some(pool.take(owners, 1)?);
            self.admitted.store(true, Ordering::SeqCst);
        }
        Ok(())
    }

    fn was_admitted(&self) -> bool {
        self.admitted.load(Ordering::SeqCst)
    }
}

/// The error of a call beyond a limit.
fn busy(message: impl Into<String>) -> RequestError {
    RequestError::Busy(message.into())
}
