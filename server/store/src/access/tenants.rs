//! Usage and quotas of tenants.

use crate::scripts::{quotas, usage};
use crate::transaction::transaction;
use crate::{JobKind, Store, StoreError, Tenant};
use yoto_proto::v1::{Quota, Usage};

impl Store {
    /// What a tenant uses, with its quota.
    pub async fn usage(&self, tenant: &Tenant) -> Result<Usage, StoreError> {
        usage::of(&mut self.db.read().await?, tenant).await
    }

    /// What each tenant uses, by id.
    pub async fn all_usage(&self) -> Result<Vec<Usage>, StoreError> {
        let mut tx = self.db.read().await?;
        let mut all = Vec::new();
        for tenant in usage::tenants(&mut tx).await? {
            all.push(usage::of(&mut tx, &tenant).await?);
        }
        Ok(all)
    }

    /// Refuses a job of this kind that would be refused if it was queued now.
    pub async fn check_quota(&self, tenant: &Tenant, kind: JobKind) -> Result<(), StoreError> {
        quotas::check_job(&mut self.db.read().await?, tenant, kind).await
    }

    /// Replaces the quota of a tenant, and returns what it uses.
    pub async fn set_quota(&self, tenant: &Tenant, quota: &Quota) -> Result<Usage, StoreError> {
        transaction!(self, |tx| async {
            quotas::set(tx, tenant, quota).await?;
            usage::of(tx, tenant).await
        })
    }
}
