//! The audit log.

use crate::audit_chain::Head;
use crate::scripts::audit;
use crate::transaction::transaction;
use crate::{AuditEntry, NewAuditEntry, Store, StoreError};

impl Store {
    /// Adds entries in their order, and returns their numbers.
    pub async fn append_audit(&self, entries: &[NewAuditEntry]) -> Result<Vec<u64>, StoreError> {
        transaction!(self, |tx| audit::append(tx, entries))
    }

    /// At most `most` entries after the one with this number, oldest first.
    pub async fn audit_after(&self, number: u64, most: u32) -> Result<Vec<AuditEntry>, StoreError> {
        audit::after(&mut self.db.read().await?, number, most).await
    }

    /// The last entry that was removed from the beginning of the log: its chain begins after it.
    pub async fn audit_cut(&self) -> Result<Head, StoreError> {
        audit::cut(&mut self.db.read().await?).await
    }

    /// The newest entries, oldest first.
    pub async fn newest_audit(&self, most: u32) -> Result<Vec<AuditEntry>, StoreError> {
        audit::newest(&mut self.db.read().await?, most).await
    }
}
