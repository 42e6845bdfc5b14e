//! Drains and cordons.

use crate::scripts::operators;
use crate::transaction::transaction;
use crate::{OperatorNote, Store, StoreError, Tenant};
use yoto_proto::v1::Draining;

impl Store {
    /// The service takes no new jobs and gives no leases, for a reason.
    pub async fn drain(&self, note: OperatorNote<'_>) -> Result<(), StoreError> {
        transaction!(self, |tx| operators::drain(tx, note))
    }

    /// The service takes jobs and gives leases again.
    pub async fn end_drain(&self) -> Result<(), StoreError> {
        transaction!(self, |tx| operators::end_drain(tx))
    }

    /// The drain of the service, if there is one.
    pub async fn draining(&self) -> Result<Option<Draining>, StoreError> {
        operators::draining(&mut self.db.read().await?).await
    }

    /// The workers called `worker` get no leases, for a reason.
    pub async fn cordon(
        &self,
        tenant: &Tenant,
        worker: &str,
        note: OperatorNote<'_>,
    ) -> Result<(), StoreError> {
        transaction!(self, |tx| operators::cordon(tx, tenant, worker, note))
    }

    /// The workers called `worker` get leases again.
    pub async fn uncordon(&self, tenant: &Tenant, worker: &str) -> Result<(), StoreError> {
        transaction!(self, |tx| operators::uncordon(tx, tenant, worker))
    }
}
