//! Addresses that are told when jobs end.

use crate::scripts::webhooks;
use crate::transaction::transaction;
use crate::{DueDelivery, NewWebhook, Store, StoreError, Tenant};
use yoto_proto::v1::Webhook;

impl Store {
    /// Adds an address of the tenant.
    pub async fn create_webhook(
        &self,
        tenant: &Tenant,
        new: &NewWebhook,
    ) -> Result<Webhook, StoreError> {
        transaction!(self, |tx| webhooks::create(tx, tenant, new))
    }

    /// The addresses of the tenant, newest first.
    pub async fn webhooks(&self, tenant: &Tenant) -> Result<Vec<Webhook>, StoreError> {
        webhooks::list(&mut self.db.snapshot().await?, tenant).await
    }

    /// Removes an address of the tenant.
    pub async fn delete_webhook(&self, tenant: &Tenant, id: &str) -> Result<(), StoreError> {
        transaction!(self, |tx| webhooks::delete(tx, tenant, id))
    }

    /// Takes up to `most` due deliveries of all tenants, which nobody else tries for `seconds`.
    pub async fn take_deliveries(
        &self,
        most: u32,
        seconds: f64,
    ) -> Result<Vec<DueDelivery>, StoreError> {
        // Mostly nothing is due, and a read takes nobody's turn to write.
        if !webhooks::any_due(&mut self.db.read().await?).await? {
            return Ok(Vec::new());
        }
        transaction!(self, |tx| webhooks::take(tx, most, seconds))
    }

    /// Notes the outcome of an attempt, and when the next one follows, if any.
    pub async fn delivery_tried(
        &self,
        delivery: &DueDelivery,
        error: &str,
        again: Option<f64>,
    ) -> Result<(), StoreError> {
        transaction!(self, |tx| webhooks::tried(tx, delivery, error, again))
    }
}
