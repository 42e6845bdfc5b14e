//! Addresses that are told when jobs end, and what they are still to be told.

use super::jobs;
use crate::db::{Row, Tx, sql};
use crate::{DueDelivery, DueWebhook, NewWebhook, StoreError, Tenant, new_id};
use yoto_proto::names::Collection;
use yoto_proto::v1::{ErrorReason, Webhook};

/// Most addresses of a tenant: each of them is told of every job.
const MOST: u64 = 16;

/// Adds an address of the tenant.
pub(crate) async fn create(
    tx: &mut Tx,
    tenant: &Tenant,
    new: &NewWebhook,
) -> Result<Webhook, StoreError> {
    let count: u64 = sql("SELECT count(*) AS webhooks FROM webhooks WHERE tenant = $1")
        .bind(tenant.id())
        .one(tx, "counting webhooks")
        .await?
        .number("webhooks")?;
    if count >= MOST {
        return Err(StoreError::Rule {
            reason: ErrorReason::Quota,
            message: format!("there are {count} webhooks; there can be {MOST}"),
        });
    }
    let id = new_id();
    sql(
        "INSERT INTO webhooks (id, tenant, url, secret, note, create_time) VALUES ($1, $2, $3, $4, $5, $6)",
    )
    .bind(&id)
    .bind(tenant.id())
    .bind(&new.url)
    .bind(&new.secret)
    .bind(&new.note)
    .bind(tx.now())
    .execute(tx, "adding a webhook")
    .await?;
    let all = list(tx, tenant).await?;
    let name = Collection::Webhooks.name(&id);
    let made = all.into_iter().find(|it| it.name == name);
    made.ok_or(StoreError::NotFound { name })
}

/// The addresses of a tenant, newest first.
pub(crate) async fn list(tx: &mut Tx, tenant: &Tenant) -> Result<Vec<Webhook>, StoreError> {
    let rows = sql("SELECT w.*,
             (SELECT count(*) FROM webhook_deliveries d WHERE d.webhook = w.id) AS waiting
         FROM webhooks w WHERE w.tenant = $1 ORDER BY w.ord DESC")
    .bind(tenant.id())
    .rows(tx, "listing webhooks")
    .await?;
    rows.iter().map(read).collect()
}

/// Removes an address of the tenant with what it was still to be told.
pub(crate) async fn delete(tx: &mut Tx, tenant: &Tenant, id: &str) -> Result<(), StoreError> {
    let done = sql("DELETE FROM webhooks WHERE id = $1 AND tenant = $2")
        .bind(id)
        .bind(tenant.id())
        .execute(tx, "removing a webhook")
        .await?;
    match done {
        0 => Err(StoreError::NotFound {
            name: Collection::Webhooks.name(id),
        }),
        _ => Ok(()),
    }
}

/// Notes that the addresses of the job's tenant are to be told of its end.
pub(crate) async fn job_ended(tx: &mut Tx, job_id: &str) -> Result<(), StoreError> {
    let rows = sql(
        "SELECT w.id FROM webhooks w JOIN jobs j ON j.tenant = w.tenant WHERE j.id = $1 ORDER BY w.ord",
    )
    .bind(job_id)
    .rows(tx, "looking for webhooks")
    .await?;
    for row in &rows {
        sql("INSERT INTO webhook_deliveries (id, webhook, job, next_time) VALUES ($1, $2, $3, $4)")
            .bind(new_id())
            .bind(row.text("id")?)
            .bind(job_id)
            .bind(tx.now())
            .execute(tx, "noting a delivery")
            .await?;
    }
    Ok(())
}

/// Whether something is due.
pub(crate) async fn any_due(tx: &mut Tx) -> Result<bool, StoreError> {
    sql("SELECT EXISTS (SELECT 1 FROM webhook_deliveries WHERE next_time <= $1) AS due")
        .bind(tx.now())
        .one(tx, "looking for due deliveries")
        .await?
        .flag("due")
}

/// The addresses of all tenants that are to be told something now.
pub(crate) async fn due(tx: &mut Tx) -> Result<Vec<DueWebhook>, StoreError> {
    let rows = sql("SELECT w.id, w.tenant FROM webhooks w WHERE EXISTS (
             SELECT 1 FROM webhook_deliveries d WHERE d.webhook = w.id AND d.next_time <= $1)
         ORDER BY w.ord")
    .bind(tx.now())
    .rows(tx, "looking for webhooks with due deliveries")
    .await?;
    let read = |row: &Row| {
        let tenant = row.text("tenant")?;
        let read = Tenant::new(&tenant);
        Ok(DueWebhook {
            id: row.text("id")?,
            tenant: read.ok_or(StoreError::Corrupt {
                what: "webhooks.tenant",
                detail: tenant,
            })?,
        })
    };
    rows.iter().map(read).collect()
}

/// Takes up to `most` due deliveries of the webhook, which nobody else tries for `seconds`. What was to be told of a job that waits
/// or runs again is forgotten: its next end is told.
pub(crate) async fn take(
    tx: &mut Tx,
    webhook: &DueWebhook,
    most: u32,
    seconds: f64,
) -> Result<Vec<DueDelivery>, StoreError> {
    let at = tx.now();
    sql("DELETE FROM webhook_deliveries WHERE webhook = $2 AND next_time <= $1 AND EXISTS (
             SELECT 1 FROM jobs j WHERE j.id = webhook_deliveries.job AND j.state IN ('QUEUED', 'RUNNING'))")
    .bind(at)
    .bind(&webhook.id)
    .execute(tx, "forgetting deliveries")
    .await?;
    let rows = sql(
        "UPDATE webhook_deliveries SET next_time = $1 + $2, attempts = attempts + 1
         WHERE id IN (SELECT id FROM webhook_deliveries WHERE webhook = $4 AND next_time <= $1
                 ORDER BY next_time, ord LIMIT $3)
             AND next_time <= $1
         RETURNING id, job, attempts",
    )
    .bind(at)
    .bind(seconds)
    .bind(most)
    .bind(&webhook.id)
    .rows(tx, "taking deliveries")
    .await?;
    if rows.is_empty() {
        return Ok(Vec::new());
    }
    let address = sql("SELECT url, secret FROM webhooks WHERE id = $1")
        .bind(&webhook.id)
        .one(tx, "reading a webhook")
        .await?;
    let mut taken = Vec::with_capacity(rows.len());
    for row in &rows {
        taken.push(DueDelivery {
            id: row.text("id")?,
            webhook_id: webhook.id.clone(),
            url: address.text("url")?,
            secret: address.text("secret")?,
            attempts: row.number("attempts")?,
            time: at,
            job: jobs::get(tx, &webhook.tenant, &row.text("job")?).await?,
        });
    }
    Ok(taken)
}

/// Notes the outcome of an attempt: `error` is empty after one that has succeeded. Without a later attempt in `again` seconds, nothing
/// more is tried.
pub(crate) async fn tried(
    tx: &mut Tx,
    delivery: &DueDelivery,
    error: &str,
    again: Option<f64>,
) -> Result<(), StoreError> {
    match again {
        Some(seconds) => {
            sql("UPDATE webhook_deliveries SET next_time = $2 WHERE id = $1")
                .bind(&delivery.id)
                .bind(tx.now() + seconds)
                .execute(tx, "putting a delivery off")
                .await?
        }
        None => {
            sql("DELETE FROM webhook_deliveries WHERE id = $1")
                .bind(&delivery.id)
                .execute(tx, "ending a delivery")
                .await?
        }
    };
    sql("UPDATE webhooks SET last_time = $2, last_error = $3 WHERE id = $1")
        .bind(&delivery.webhook_id)
        .bind(tx.now())
        .bind(error)
        .execute(tx, "noting an attempt")
        .await?;
    Ok(())
}

fn read(row: &Row) -> Result<Webhook, StoreError> {
    Ok(Webhook {
        name: Collection::Webhooks.name(&row.text("id")?),
        url: row.text("url")?,
        note: row.text("note")?,
        create_time: row.time("create_time")?,
        last_time: row.time("last_time")?,
        last_error: row.text("last_error")?,
        waiting: row.number("waiting")?,
    })
}
