//! Links to pages of exports.

use crate::scripts::shares;
use crate::transaction::transaction;
use crate::{Entry, NewShare, Page, ShareFilter, Shared, Store, StoreError, Tenant};
use yoto_proto::v1::Share;

impl Store {
    /// Makes a link to an export of the tenant.
    pub async fn create_share(&self, tenant: &Tenant, new: &NewShare) -> Result<Share, StoreError> {
        let required = self.requires_consent;
        transaction!(self, |tx| shares::create(tx, tenant, new, required))
    }

    /// What the link with this SHA-256 shows now; `None` if there is none, or it has ended.
    pub async fn shared(&self, sha256: &str) -> Result<Option<Shared>, StoreError> {
        let mut tx = self.db.read().await?;
        shares::shown(&mut tx, sha256, self.requires_consent).await
    }

    /// The links of the tenant, newest first.
    pub async fn shares(
        &self,
        tenant: &Tenant,
        filter: &ShareFilter,
        page: Page,
    ) -> Result<Vec<Entry<Share>>, StoreError> {
        let mut tx = self.db.read().await?;
        shares::list(&mut tx, tenant, filter, page, self.requires_consent).await
    }

    /// Revokes a link of the tenant.
    pub async fn revoke_share(&self, tenant: &Tenant, id: &str) -> Result<Share, StoreError> {
        let required = self.requires_consent;
        transaction!(self, |tx| shares::revoke(tx, tenant, id, required))
    }
}
