//! The coordinator's memory: the catalogue and the job queue.
//!
//! [`Store`] is its edge: each method is one transaction, and what a user can reach takes the tenant first. Below it are the
//! transactions' scripts, one set for all databases, and the narrow connection [`db`] over which they run. Ids are bare
//! (`{id}`), since callers have parsed the names.

mod access;
pub mod audit_chain;
mod audit_types;
pub mod binding;
mod db;
mod erasure_types;
mod error;
mod job_types;
mod key_types;
mod page_types;
#[cfg(test)]
mod race_tests;
pub mod rules;
mod scripts;
#[cfg(test)]
mod stage;
mod tenant;
mod trace_parent;
mod transaction;
mod types;
mod webhook_types;

pub use audit_types::{AuditEntry, NewAuditEntry};
pub use db::{Listener, PostgresUrl, UrlError};
pub use erasure_types::{
    Counted, Leaving, LeftModel, OpenErasure, SharedWeights, SignedReport, Trace, Work,
};
pub use error::StoreError;
pub use job_types::{
    EndedJob, Ending, JobFilter, JobKind, JobVersion, JobVersions, LeaseKey, LeaseOutcome,
    LeasedJob, NewJob, OpenJobs, QueueFigures, Reaped, StoppedJob, TakenRange,
};
pub use key_types::{KeyRow, NewKey};
pub use page_types::{CaptureFiles, JobGroup, Membership, Person};
pub use scripts::service_state::ServiceState;
pub use tenant::Tenant;
pub use trace_parent::TraceParent;
pub use types::{
    Entry, Horizons, KnownGarbage, NamedObject, NewConsent, NewEvidence, NewModel, NewPart,
    NewPiece, NewShare, NewSubject, NewUpload, NewWorker, OperatorNote, Page, PartId, Reference,
    References, RequestKey, ShareFilter, Shared, StoredPart, SubjectChange, Target, Upload,
    UploadFile, UploadPart, UploadedFile, new_id,
};
pub use webhook_types::{DueDelivery, DueWebhook, NewWebhook};

use db::Database;
use scripts::steps::Checks;
use std::path::Path;
use std::sync::Arc;
use tokio::sync::Mutex;
use yoto_process::clock::Clock;

/// The catalogue and the job queue. If the database fails, each method returns [`StoreError::Unavailable`],
/// [`StoreError::Conflict`] or [`StoreError::Database`], depending on what a caller can do.
#[derive(Debug)]
pub struct Store {
    db: Database,
    /// Checks of the clock by this process.
    checks: Mutex<Option<Checks>>,
    /// Whether nobody is in a job without a valid consent to its purpose.
    requires_consent: bool,
}

impl Store {
    /// Opens the database file, creating it and bringing its schema up to date. Jobs and leases run by
    /// `clock`.
    ///
    /// # Errors
    /// When the file can't be opened, or is of another program or a newer version.
    pub async fn open_sqlite(path: &Path, clock: Arc<dyn Clock>) -> Result<Self, StoreError> {
        Ok(Self::of(Database::open_sqlite(path, clock).await?))
    }

    /// Opens a database of PostgreSQL and brings its schema up to date. Jobs and leases run by the database's clock, unless
    /// `clock` is a test's.
    ///
    /// # Errors
    /// When the database can't be reached, is in use by a coordinator of another version, or is of another program or a newer
    /// version.
    pub async fn open_postgres(
        url: &PostgresUrl,
        clock: Arc<dyn Clock>,
    ) -> Result<Self, StoreError> {
        Ok(Self::of(Database::open_postgres(url, clock).await?))
    }

    /// Opens the file of a service that exists and may run, for a few rows: its schema must be that of this program.
    ///
    /// # Errors
    /// When there is no such file, or its schema is another.
    pub async fn open_sqlite_as_it_is(
        path: &Path,
        clock: Arc<dyn Clock>,
    ) -> Result<Self, StoreError> {
        Ok(Self::of(Database::open_sqlite_as_it_is(path, clock).await?))
    }

    /// Opens an existing file to read what is in it, also beside a coordinator. Every method that writes fails.
    ///
    /// # Errors
    /// When the file can't be opened, or its schema is not this version's.
    pub async fn inspect_sqlite(path: &Path, clock: Arc<dyn Clock>) -> Result<Self, StoreError> {
        Ok(Self::of(Database::inspect_sqlite(path, clock).await?))
    }

    /// Opens a database of PostgreSQL to read what is in it, also beside coordinators of this version. Others can't change the
    /// schema meanwhile.
    ///
    /// # Errors
    /// When the database can't be reached, or its schema is not this version's.
    pub async fn inspect_postgres(
        url: &PostgresUrl,
        clock: Arc<dyn Clock>,
    ) -> Result<Self, StoreError> {
        Ok(Self::of(Database::inspect_postgres(url, clock).await?))
    }

    fn of(db: Database) -> Self {
        Self {
            db,
            checks: Mutex::default(),
            requires_consent: false,
        }
    }

    /// The store with jobs only of people who have agreed to them, if `required`. Otherwise only a consent that was revoked or
    /// has run out keeps a person out of jobs.
    pub fn requiring_consent(self, required: bool) -> Self {
        Self {
            requires_consent: required,
            ..self
        }
    }

    /// Whether other coordinators may use the database.
    pub fn is_shared(&self) -> bool {
        self.db.is_shared()
    }

    /// Sends a text of less than 8000 bytes to the coordinators that [listen](Self::listen), this one too.
    ///
    /// # Errors
    /// When the database can't be reached.
    pub async fn notify(&self, text: &str) -> Result<(), StoreError> {
        self.db.notify(text).await
    }

    /// Receives texts of coordinators; `None` if there can't be others.
    ///
    /// # Errors
    /// When the database can't be reached.
    pub async fn listen(&self) -> Result<Option<Listener>, StoreError> {
        self.db.listen().await
    }

    /// Waits for running statements and closes the database.
    pub async fn close(&self) {
        self.db.close().await;
    }
}
