//! State that all services and background tasks of a coordinator share, in parts: a room takes the part that it needs.

use crate::access::Callers;
use crate::audit::Audit;
use crate::config::ServerConfig;
use crate::data_dir::OwnDataDir;
use crate::health::HealthCheck;
use crate::notify::Notifier;
use crate::objects::Storage;
use crate::objects::room::{self, Room};
use crate::sign_in::IssuerCache;
use crate::uploads::UploadLocks;
use std::sync::Arc;
use std::time::SystemTime;
use tokio_util::sync::CancellationToken;
use yoto_objects::Objects;
use yoto_request::RequestError;
use yoto_store::Store;

/// The shared parts.
pub(crate) struct Context {
    /// Settings.
    pub config: ServerConfig,
    /// The catalogue and the queue.
    pub store: Arc<Store>,
    /// Uploads, shards, checkpoints, renders.
    pub objects: Objects,
    /// Where the objects are.
    pub storage: Arc<Storage>,
    /// Tells of changes of jobs.
    pub notifier: Arc<Notifier>,
    /// Who may call.
    pub callers: Arc<Callers>,
    /// The issuer of OpenID Connect, once somebody has signed in.
    pub issuer: IssuerCache,
    /// Writes the audit log.
    pub audit: Arc<Audit>,
    /// Whether database and object store work.
    pub health: Arc<HealthCheck>,
    /// The writers of uploads in this process.
    pub upload_locks: UploadLocks,
    /// Steps of which one at a time is done.
    pub alone: Alone,
    /// When the coordinator started.
    pub started: SystemTime,
    /// Ends background tasks and watch streams.
    pub stop: CancellationToken,
    /// The data folder stays locked as long as anything can write to it.
    pub data_dir: OwnDataDir,
}

/// Steps of which a process does one at a time. Those of several coordinators may meet.
#[derive(Debug, Default)]
pub(crate) struct Alone {
    /// Held during a collection: a second one would find and remove the same again.
    pub collecting: tokio::sync::Mutex<()>,
    /// Held during a check of all leases: a second one would return while the first still takes jobs back.
    pub reaping: tokio::sync::Mutex<()>,
    /// Held during a step of the erasures.
    pub erasing: tokio::sync::Mutex<()>,
}

impl Context {
    /// Refuses if `coming` more bytes would leave less than the configured free space on the disk of the object
    /// store, or of what its limit allows; or on the disk of the data folder, where the database is.
    pub(crate) fn ensure_room(&self, coming: u64) -> Result<(), RequestError> {
        let min_free = self.config.storage.min_free_bytes;
        room::check(self.storage.place.room(), coming, min_free)?;
        room::check(Room::of(&self.config.data_dir), coming, min_free)
    }
}
