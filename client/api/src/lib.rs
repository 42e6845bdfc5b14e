//! A thin asynchronous client of the `yoto.v1` API.
//!
//! One type, [`YotoClient`], over one shared channel, with one file per resource. It adds only what
//! every caller needs: request ids, repeated calls, paging, uploads and watch streams that survive a
//! lost connection, and errors that name the file, frame and field at fault.

mod addresses;
mod consents;
mod direct;
mod erasures;
mod error;
mod jobs;
mod keys;
mod models;
mod objects;
mod pages;
mod renders;
mod resolve;
mod retry;
mod shares;
mod status;
mod storage;
mod subjects;
mod tenants;
mod tls;
mod transfer;
mod upload;
mod watch;
mod watch_all;
mod webhooks;

pub use addresses::Addresses;
pub use consents::NewConsent;
pub use error::{ClientError, Refusal};
pub use resolve::pick_name;
pub use upload::{FileSource, UploadFile};
pub use watch::{JobChange, JobWatch};
pub use watch_all::{JobsChange, JobsFilter, JobsWatch};

use direct::Direct;
use std::sync::Arc;
use tonic::transport::Channel;
use yoto_proto::key::{Connection, Key, connection};
use yoto_proto::v1::JobPriority;

/// Default address of `yoto serve`.
pub const DEFAULT_SERVER: &str = "http://127.0.0.1:50051";

/// A connection to a yoto service. Cheap to clone; clones share the connection.
#[derive(Debug, Clone)]
pub struct YotoClient {
    channel: Connection,
    direct: Arc<Direct>,
    queue: QueueOptions,
}

/// Order of new jobs in the queue of a service.
#[derive(Debug, Clone, Default)]
pub struct QueueOptions {
    /// Jobs of a higher priority come first.
    pub priority: JobPriority,
    /// Name of the person or project that jobs run for: among jobs of the same priority, the owner with the fewest
    /// running jobs comes first.
    pub owner: String,
}

impl YotoClient {
    /// Connects to `server`, e.g. [`DEFAULT_SERVER`]; several addresses have commas between them.
    ///
    /// # Errors
    /// When `server` is not an address or nothing answers there.
    pub async fn connect(server: &str) -> Result<Self, ClientError> {
        Self::connect_to(&Addresses::parse(server)?, None).await
    }

    /// Connects to the service at these addresses, which are called with `key`.
    ///
    /// # Errors
    /// When nothing answers there.
    pub async fn connect_to(addresses: &Addresses, key: Option<Key>) -> Result<Self, ClientError> {
        let client = Self::with_key(addresses.connect().await?, key);
        Ok(match addresses.are_encrypted() {
            true => client,
            false => client.with_clear_store(),
        })
    }

    /// A client over an existing channel, such as the in-memory channel of an embedded
    /// service.
    pub fn new(channel: Channel) -> Self {
        Self::with_key(channel, None)
    }

    /// A client that makes its calls with `key`, where the service asks for one.
    pub fn with_key(channel: Channel, key: Option<Key>) -> Self {
        Self {
            channel: connection(channel, key),
            direct: Arc::new(Direct::new(false)),
            queue: QueueOptions::default(),
        }
    }

    /// A client that may read from and write to an object store without TLS, where the service names one. Others leave such
    /// a store to the service.
    #[must_use]
    pub fn with_clear_store(self) -> Self {
        Self {
            direct: Arc::new(Direct::new(true)),
            ..self
        }
    }

    /// A connection that gives new jobs these options.
    #[must_use]
    pub fn with_queue_options(self, queue: QueueOptions) -> Self {
        Self { queue, ..self }
    }
}

/// Makes repeated delivery of a create request harmless.
fn request_id() -> String {
    uuid::Uuid::new_v4().to_string()
}
