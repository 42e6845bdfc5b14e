//! Keys of callers.

use crate::scripts::keys;
use crate::transaction::transaction;
use crate::{Entry, KeyRow, NewKey, Page, Store, StoreError, Tenant};
use yoto_proto::v1::Key;

impl Store {
    /// Adds a key of the tenant.
    pub async fn create_key(&self, tenant: &Tenant, new: &NewKey) -> Result<Key, StoreError> {
        transaction!(self, |tx| keys::create(tx, tenant, new))
    }

    /// All keys of all tenants, and the time at which they were read, seconds since 1970.
    pub async fn all_keys(&self) -> Result<(Vec<KeyRow>, f64), StoreError> {
        let mut tx = self.db.read().await?;
        let now = tx.now();
        Ok((keys::all(&mut tx).await?, now))
    }

    /// The keys of the tenant, newest first.
    pub async fn keys(&self, tenant: &Tenant, page: Page) -> Result<Vec<Entry<Key>>, StoreError> {
        keys::list(&mut self.db.read().await?, tenant, page).await
    }

    /// A key of any tenant.
    pub async fn key(&self, id: &str) -> Result<Key, StoreError> {
        keys::get(&mut self.db.read().await?, None, id).await
    }

    /// Revokes a key of the tenant; without one, of any.
    pub async fn revoke_key(&self, tenant: Option<&Tenant>, id: &str) -> Result<Key, StoreError> {
        transaction!(self, |tx| keys::revoke(tx, tenant, id))
    }

    /// Notes that the key was used.
    pub async fn note_key_use(&self, id: &str) -> Result<(), StoreError> {
        transaction!(self, |tx| keys::note_use(tx, id))
    }
}
