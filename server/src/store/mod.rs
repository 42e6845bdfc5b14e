//! The coordinator's memory: the catalogue and the job queue.
//!
//! [`Store`] is its edge: each method is one transaction, and what a user can reach takes the tenant first. Below it are the
//! transactions' scripts, one set for all databases, and the narrow connection [`db`] over which they run. Ids are bare
//! (`{id}`), since callers have parsed the names.

mod access;
mod db;
mod job_types;
mod scripts;
mod types;

pub use job_types::{
    Ending, JobFilter, JobKind, JobVersions, LeaseKey, LeaseOutcome, LeasedJob, NewJob, Reaped,
    TakenRange,
};
pub use types::{
    CommittedPart, Entry, Horizons, KnownGarbage, NewModel, NewSubject, NewUpload, NewWorker, Page,
    Reference, RequestKey, StoreError, SubjectChange, Target, Upload, UploadFile, UploadedFile,
    new_id,
};

use crate::clock::Clock;
use crate::tenant::Tenant;
use db::{Database, Tx};
use scripts::leases;
use scripts::steps::Checks;
use std::path::Path;
use std::sync::Arc;
use tokio::sync::Mutex;

/// The catalogue and the job queue. If the database fails, each method returns [`StoreError::Unavailable`],
/// [`StoreError::Conflict`] or [`StoreError::Database`], depending on what a caller can do.
#[derive(Debug)]
pub struct Store {
    db: Database,
    /// Checks of the clock by this process.
    checks: Mutex<Option<Checks>>,
}

impl Store {
    /// Opens the database file, creating it and bringing its schema up to date. Jobs and leases run by
    /// `clock`.
    ///
    /// # Errors
    /// When the file can't be opened, or holds a schema that is newer or altered.
    pub async fn open_sqlite(path: &Path, clock: Arc<dyn Clock>) -> Result<Self, StoreError> {
        Ok(Self {
            db: Database::open_sqlite(path, clock).await?,
            checks: Mutex::default(),
        })
    }

    /// Starts a write under a lease, whose job and worker must be of the tenant.
    async fn write_under(&self, tenant: &Tenant, lease: &LeaseKey) -> Result<Tx, StoreError> {
        let mut tx = self.db.write().await?;
        leases::require(&mut tx, tenant, lease).await?;
        Ok(tx)
    }

    /// Waits for running statements and closes the database.
    pub async fn close(&self) {
        self.db.close().await;
    }
}
