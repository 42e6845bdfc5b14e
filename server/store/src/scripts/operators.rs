//! What operators say of the service and of its workers: drains and cordons.

use super::service_state::by;
use crate::db::{Tx, sql};
use crate::{OperatorNote, StoreError, Tenant};
use yoto_proto::v1::{Draining, ErrorReason};

/// The condition that worker `$1` may get leases.
macro_rules! admitted {
    () => {
        "NOT EXISTS (SELECT 1 FROM drains)
           AND NOT EXISTS (SELECT 1 FROM cordons c JOIN workers w
                           ON w.tenant = c.tenant AND w.display_name = c.worker WHERE w.id = $1)"
    };
}
pub(super) use admitted;

/// Begins a drain of the service, or changes its reason.
pub(crate) async fn drain(tx: &mut Tx, note: OperatorNote<'_>) -> Result<(), StoreError> {
    sql(
        "INSERT INTO drains (id, reason, since, by_key) VALUES (1, $1, $2, $3)
         ON CONFLICT (id) DO UPDATE SET reason = $1, by_key = $3",
    )
    .bind(note.reason)
    .bind(tx.now())
    .bind(note.key)
    .execute(tx, "draining the service")
    .await?;
    Ok(())
}

/// Ends the drain of the service.
pub(crate) async fn end_drain(tx: &mut Tx) -> Result<(), StoreError> {
    let statement = sql("DELETE FROM drains");
    statement.execute(tx, "ending a drain").await?;
    Ok(())
}

/// The drain of the service, if there is one.
pub(crate) async fn draining(tx: &mut Tx) -> Result<Option<Draining>, StoreError> {
    let row = sql("SELECT reason, since, by_key FROM drains")
        .row(tx, "looking for a drain")
        .await?;
    row.map(|row| {
        Ok(Draining {
            reason: row.text("reason")?,
            since: row.time("since")?,
            by: by(&row)?,
        })
    })
    .transpose()
}

/// Refuses a new job during a drain.
pub(crate) async fn require_open(tx: &mut Tx) -> Result<(), StoreError> {
    match draining(tx).await? {
        None => Ok(()),
        Some(Draining { reason, .. }) => {
            let because = match reason.as_str() {
                "" => String::new(),
                reason => format!(": {reason}"),
            };
            Err(StoreError::Rule {
                reason: ErrorReason::Draining,
                message: format!("the service is drained and takes no new jobs{because}"),
            })
        }
    }
}

/// Cordons the workers called `worker`, or changes the reason.
pub(crate) async fn cordon(
    tx: &mut Tx,
    tenant: &Tenant,
    worker: &str,
    note: OperatorNote<'_>,
) -> Result<(), StoreError> {
    sql(
        "INSERT INTO cordons (tenant, worker, reason, since, by_key) VALUES ($1, $2, $3, $4, $5)
         ON CONFLICT (tenant, worker) DO UPDATE SET reason = $3, by_key = $5",
    )
    .bind(tenant.id())
    .bind(worker)
    .bind(note.reason)
    .bind(tx.now())
    .bind(note.key)
    .execute(tx, "cordoning a worker")
    .await?;
    Ok(())
}

/// Ends the cordon of the workers called `worker`.
pub(crate) async fn uncordon(tx: &mut Tx, tenant: &Tenant, worker: &str) -> Result<(), StoreError> {
    sql("DELETE FROM cordons WHERE tenant = $1 AND worker = $2")
        .bind(tenant.id())
        .bind(worker)
        .execute(tx, "uncordoning a worker")
        .await?;
    Ok(())
}
