//! Sequence numbers of jobs, by which watchers find what has changed without reading the jobs.

use crate::store::db::{Tx, sql};
use crate::store::{JobVersions, StoreError};
use crate::tenant::Tenant;

/// The tenant's open jobs, and all of its jobs after the position `after`.
pub async fn list(
    tx: &mut Tx,
    tenant: &Tenant,
    after: Option<i64>,
) -> Result<JobVersions, StoreError> {
    // Read first: a job that comes in between is after it, and is found by the next call.
    let newest = sql("SELECT coalesce(max(ord), 0) AS newest FROM jobs WHERE tenant = $1")
        .bind(tenant.id())
        .one(tx, "reading the position of the newest job")
        .await?
        .number("newest")?;
    let rows = sql(
        "SELECT id, sequence FROM jobs WHERE tenant = $2 AND (state IN ('QUEUED', 'RUNNING') OR ord > $1)
         ORDER BY ord",
    )
    .bind(after.unwrap_or(i64::MAX))
    .bind(tenant.id())
    .rows(tx, "reading which jobs have changed").await?;
    let jobs = rows
        .iter()
        .map(|row| Ok((row.text("id")?, row.number("sequence")?)));
    Ok(JobVersions {
        newest,
        jobs: jobs.collect::<Result<_, StoreError>>()?,
    })
}
