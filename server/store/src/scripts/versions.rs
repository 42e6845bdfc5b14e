//! Sequence numbers of jobs, by which watchers find what has changed without reading the jobs.

use crate::db::{Tx, sql};
use crate::{JobVersion, JobVersions, StoreError, Tenant};

/// Positions before the newest one that a reading looks at once more. PostgreSQL gives a position when a row is inserted, so a
/// job may be committed after a newer one was read: as many newer jobs would have to be queued between its INSERT and its
/// COMMIT for a reading to miss it.
const LATE: i64 = 1000;

/// The tenant's open jobs, and its jobs of whatever state at the end: those after the position `after`, which an earlier
/// reading called the newest, and the last ones before it.
pub(crate) async fn list(
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
        "SELECT id, sequence, state IN ('QUEUED', 'RUNNING') AS is_open
         FROM jobs WHERE tenant = $2 AND (state IN ('QUEUED', 'RUNNING') OR ord > $1) ORDER BY ord",
    )
    .bind(after.unwrap_or(newest).saturating_sub(LATE))
    .bind(tenant.id())
    .rows(tx, "reading which jobs have changed")
    .await?;
    let jobs = rows.iter().map(|row| {
        Ok(JobVersion {
            id: row.text("id")?,
            sequence: row.number("sequence")?,
            is_open: row.flag("is_open")?,
        })
    });
    Ok(JobVersions {
        newest,
        jobs: jobs.collect::<Result<_, StoreError>>()?,
    })
}
