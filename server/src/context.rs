//! State that all services and background tasks of a coordinator share.

use crate::access::keys::KeyRing;
use crate::access::rates::Rates;
use crate::audit::Audit;
use crate::changes::JobChanges;
use crate::config::ServerConfig;
use crate::health::Health;
use crate::hints::{Hint, Hints};
use crate::job_feed::JobFeed;
use crate::lock::DataDirLock;
use crate::objects::place::Place;
use crate::objects::room::{self, Room};
use crate::otlp::EndedJobs;
use crate::sign_in::Found;
use crate::uploads::UploadLocks;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};
use tokio::sync::watch;
use tokio_util::sync::CancellationToken;
use url::Url;
use yoto_objects::Objects;
use yoto_request::RequestError;
use yoto_store::Tenant;
use yoto_store::{JobKind, Store};

/// The shared parts. The lock is one of them, so the data folder stays locked as long as
/// anything can write to it.
pub struct Context {
    /// Settings.
    pub config: ServerConfig,
    /// The catalogue and the queue.
    pub store: Store,
    /// Uploads, shards, checkpoints, renders.
    pub objects: Objects,
    /// Where the objects are.
    pub objects_url: Url,
    /// The id of the object store: a random number that only the database and the store have.
    pub store_id: String,
    /// Where that is, for operations that the object store's interface lacks.
    pub place: Place,
    /// Wakes the watchers of jobs.
    pub changes: JobChanges,
    /// The changes of all jobs, for those who watch them.
    pub feed: JobFeed,
    /// Jobs that have ended here, if their traces are sent.
    pub ended: Option<Arc<EndedJobs>>,
    /// Hints for waiting workers, and those of other coordinators.
    pub hints: Hints,
    /// Which of several coordinators of one database it is: the same after each start.
    pub instance: String,
    /// When the coordinator started.
    pub started: SystemTime,
    /// What the health check has found.
    pub health: watch::Sender<Health>,
    /// The last answer of `/metrics`, and when it was written.
    pub exposed: tokio::sync::Mutex<Option<(Instant, String)>>,
    /// The keys of callers.
    pub keys: KeyRing,
    /// Calls per second of tenants.
    pub rates: Rates,
    /// The issuer of OpenID Connect, once somebody has signed in.
    pub sign_in: Found,
    /// Writes the audit log.
    pub audit: Audit,
    /// Ends background tasks and watch streams.
    pub stop: CancellationToken,
    /// Keeps other coordinators off the data folder.
    pub lock: DataDirLock,
    /// The writers of uploads in this process.
    pub upload_locks: UploadLocks,
    /// Held during a collection: a second one of the same process would find and remove the same again. Collections of
    /// several coordinators may meet ([`crate::objects::collect`]).
    pub collecting: tokio::sync::Mutex<()>,
    /// Held during a check of all leases: a second one of the same process would return while the first still takes
    /// jobs back.
    pub reaping: tokio::sync::Mutex<()>,
    /// Held during a step of the erasures.
    pub erasing: tokio::sync::Mutex<()>,
}

impl Context {
    /// The job called `jobs/{id}` has changed: its watchers look at it, at each coordinator.
    pub fn announce(&self, job: &str) {
        self.changes.announce(job);
        self.hints.tell(Hint::Changed(job.to_owned()));
    }

    /// [`Self::announce`] for a job that has ended, or may have: a lease of it has.
    pub fn announce_end(&self, job: &str) {
        self.announce(job);
        if let Some(ended) = &self.ended {
            ended.note(job);
        }
    }

    /// A job of this kind waits for a worker: one that waits at this coordinator asks for it, and one at each other.
    pub fn queued(&self, tenant: &Tenant, kind: JobKind) {
        self.hints.waiting.wake(tenant, kind);
        self.hints.tell(Hint::queued(tenant, kind));
    }

    /// Interval between reads of a watched job without announced changes.
    pub fn watch_poll(&self) -> Duration {
        match self.hints.are_heard() {
            true => self.config.hinted_poll,
            false => self.config.watch_poll,
        }
    }

    /// Refuses if `coming` more bytes would leave less than the configured free space on the disk of the object
    /// store, or of what its limit allows; or on the disk of the data folder, where the database is.
    pub fn ensure_room(&self, coming: u64) -> Result<(), RequestError> {
        let min_free = self.config.storage.min_free_bytes;
        room::check(self.place.room(), coming, min_free)?;
        room::check(Room::of(&self.config.data_dir), coming, min_free)
    }
}
