//! Quotas of tenants. Each check locks the quota first, so that two calls at a time can't both take the last place. A tenant
//! without a quota has no row: nothing is locked, and nothing is counted.

use super::usage;
use crate::db::{Lock, Tx, integer, sql};
use crate::{JobKind, StoreError, Tenant};
use yoto_proto::v1::Quota;

/// Replaces the quota of a tenant.
pub(crate) async fn set(tx: &mut Tx, tenant: &Tenant, quota: &Quota) -> Result<(), StoreError> {
    let column = |field, value: Option<u64>| value.map(|it| integer(field, it)).transpose();
    sql(
        "INSERT INTO quotas (tenant, people, bytes, open_jobs, device_seconds, pictures, calls_per_second)
         VALUES ($1, $2, $3, $4, $5, $6, $7)
         ON CONFLICT (tenant) DO UPDATE SET people = $2, bytes = $3, open_jobs = $4,
             device_seconds = $5, pictures = $6, calls_per_second = $7",
    )
    .bind(tenant.id())
    .bind(column("quota.people", quota.people)?)
    .bind(column("quota.bytes", quota.bytes)?)
    .bind(column("quota.open_jobs", quota.open_jobs)?)
    .bind(quota.device_seconds)
    .bind(column("quota.pictures", quota.pictures)?)
    .bind(quota.calls_per_second)
    .execute(tx, "setting a quota")
    .await?;
    Ok(())
}

/// Refuses another person.
pub(crate) async fn admit_person(tx: &mut Tx, tenant: &Tenant) -> Result<(), StoreError> {
    if let Some(most) = locked(tx, tenant).await?.people {
        refuse_beyond("people", usage::people(tx, tenant).await?, 1, most)?;
    }
    Ok(())
}

/// Refuses an upload of `coming` bytes.
pub(crate) async fn admit_upload(
    tx: &mut Tx,
    tenant: &Tenant,
    coming: u64,
) -> Result<(), StoreError> {
    if let Some(most) = locked(tx, tenant).await?.bytes {
        refuse_beyond("bytes", usage::bytes(tx, tenant).await?, coming, most)?;
    }
    Ok(())
}

/// Refuses another job of this kind.
pub(crate) async fn admit_job(
    tx: &mut Tx,
    tenant: &Tenant,
    kind: JobKind,
) -> Result<(), StoreError> {
    tx.lock(Lock::Quota(tenant.id())).await?;
    check_job(tx, tenant, kind).await
}

/// Whether another job of this kind would be refused now. How long it will take and what it will write is not known, so it is
/// refused once nothing is left.
pub(crate) async fn check_job(
    tx: &mut Tx,
    tenant: &Tenant,
    kind: JobKind,
) -> Result<(), StoreError> {
    let quota = usage::quota(tx, tenant).await?;
    if let Some(most) = quota.open_jobs {
        refuse_beyond("open_jobs", usage::open_jobs(tx, tenant).await?, 1, most)?;
    }
    let work = match (quota.device_seconds, quota.pictures) {
        (None, None) => None,
        _ => Some(usage::work(tx, tenant).await?),
    };
    if let (Some(most), Some(work)) = (quota.device_seconds, work)
        && work.device_seconds >= most
    {
        return Err(reached("device_seconds", work.device_seconds, most));
    }
    if let (Some(most), Some(work), JobKind::Render) = (quota.pictures, work, kind) {
        refuse_beyond("pictures", work.pictures, 1, most)?;
    }
    if let Some(most) = quota.bytes
        && kind != JobKind::Evaluate
    {
        refuse_beyond("bytes", usage::bytes(tx, tenant).await?, 1, most)?;
    }
    Ok(())
}

/// The quota, which nobody else checks until the transaction ends.
async fn locked(tx: &mut Tx, tenant: &Tenant) -> Result<Quota, StoreError> {
    tx.lock(Lock::Quota(tenant.id())).await?;
    usage::quota(tx, tenant).await
}

fn refuse_beyond(quota: &'static str, used: u64, coming: u64, most: u64) -> Result<(), StoreError> {
    match used.saturating_add(coming) <= most {
        true => Ok(()),
        false => Err(reached(quota, used as f64, most as f64)),
    }
}

fn reached(quota: &'static str, used: f64, most: f64) -> StoreError {
    StoreError::QuotaReached { quota, used, most }
}
