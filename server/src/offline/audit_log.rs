//! The audit log in a service's database, for its operator on its own host.

use super::on_host;
use crate::error::ServerError;
use std::path::Path;
use thiserror::Error;
use yoto_store::audit_chain::{Broken, Head};
use yoto_store::{AuditEntry, PostgresUrl, Store, StoreError};

/// Entries that are read at a time.
const PAGE: u32 = 1000;

/// The audit log can't be read, or is not what was written.
#[derive(Debug, Error)]
pub enum AuditError {
    /// The database.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The chain.
    #[error("the audit log is broken: {0}")]
    Broken(#[from] Broken),
    /// The noted entry was removed because of its age.
    #[error(
        "entry {number} was removed because of its age (--audit-days of `yoto serve`): the log begins with entry {first}"
    )]
    Removed {
        /// The noted entry.
        number: u64,
        /// The first one that is there.
        first: u64,
    },
    /// The chain is whole, but not the one that was noted.
    #[error(
        "the audit log is not the one that was noted: entry {number} has the hash {found}, not {noted}"
    )]
    NotAsNoted {
        /// The noted entry.
        number: u64,
        /// Its hash now; empty: there is no such entry any more.
        found: String,
        /// Its hash as noted.
        noted: String,
    },
}

/// The audit log of a service. The service may run.
pub struct AuditLog {
    store: Store,
}

impl AuditLog {
    /// Opens the log in the SQLite database of a data folder.
    ///
    /// # Errors
    /// When no service was in the folder, or one of an earlier version.
    pub async fn in_folder(folder: &Path) -> Result<Self, ServerError> {
        let store = on_host::in_folder(folder).await?;
        Ok(Self { store })
    }

    /// Opens the log in a database of PostgreSQL.
    ///
    /// # Errors
    /// When the database can't be reached, or is in use by a coordinator of another version.
    pub async fn in_postgres(url: &PostgresUrl) -> Result<Self, ServerError> {
        let store = on_host::in_postgres(url).await?;
        Ok(Self { store })
    }

    /// The newest `most` entries, oldest first.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn newest(&self, most: u32) -> Result<Vec<AuditEntry>, AuditError> {
        Ok(self.store.newest_audit(most).await?)
    }

    /// Walks the whole chain, from the entries that were removed because of their age, and returns its end. `noted` is an end that an earlier call returned. Without it, a chain that was
    /// cut, or rewritten from some entry on, looks whole.
    ///
    /// # Errors
    /// When an entry was changed or is missing, or the noted one is gone or has another hash.
    pub async fn verify(&self, noted: Option<&Head>) -> Result<Head, AuditError> {
        let mut head = self.store.audit_cut().await?;
        if let Some(noted) = noted
            && noted.number < head.number
        {
            return Err(AuditError::Removed {
                number: noted.number,
                first: head.number + 1,
            });
        }
        let mut found = noted
            .filter(|it| it.number == head.number)
            .map(|_| head.hash.clone());
        loop {
            let entries = self.store.audit_after(head.number, PAGE).await?;
            if entries.is_empty() {
                break;
            }
            for entry in &entries {
                head = head.then(entry)?;
                if noted.is_some_and(|it| it.number == head.number) {
                    found = Some(head.hash.clone());
                }
            }
        }
        match noted {
            Some(noted) if found.as_ref() != Some(&noted.hash) => Err(AuditError::NotAsNoted {
                number: noted.number,
                found: found.unwrap_or_default(),
                noted: noted.hash.clone(),
            }),
            _ => Ok(head),
        }
    }

    /// Closes the database.
    pub async fn close(self) {
        self.store.close().await;
    }
}
