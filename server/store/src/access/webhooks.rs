//! Addresses that are told when jobs end.

use crate::scripts::webhooks;
use crate::transaction::transaction;
use crate::{DueDelivery, DueWebhook, NewWebhook, Store, StoreError, Tenant};
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

    /// The addresses of all tenants that are to be told something now.
    pub async fn due_webhooks(&self) -> Result<Vec<DueWebhook>, StoreError> {
        // Mostly nothing is due, and a look at all deliveries is the quickest.
        let mut tx = self.db.snapshot().await?;
        if !webhooks::any_due(&mut tx).await? {
            return Ok(Vec::new());
        }
        webhooks::due(&mut tx).await
    }

    /// Takes up to `most` due deliveries of the webhook, which nobody else tries for `seconds`.
    pub async fn take_deliveries(
        &self,
        webhook: &DueWebhook,
        most: u32,
        seconds: f64,
    ) -> Result<Vec<DueDelivery>, StoreError> {
        transaction!(self, |tx| webhooks::take(tx, webhook, most, seconds))
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
