//! Sequence numbers of jobs, by which watchers find what has changed without reading the jobs.

use super::rows::{Columns, During};
use crate::store::{JobVersions, StoreError};
use sqlx::SqliteConnection;

/// The open jobs, and all jobs after the position `after`.
pub async fn list(
    conn: &mut SqliteConnection,
    after: Option<i64>,
) -> Result<JobVersions, StoreError> {
    // Read first: a job that comes in between is after it, and is found by the next call.
    let newest = sqlx::query("SELECT coalesce(max(ord), 0) AS newest FROM jobs")
        .fetch_one(&mut *conn)
        .await
        .during("reading the position of the newest job")?
        .number("newest")?;
    let rows = sqlx::query(
        "SELECT id, sequence FROM jobs WHERE state IN ('QUEUED', 'RUNNING') OR ord > ?1 ORDER BY ord",
    )
    .bind(after.unwrap_or(i64::MAX))
    .fetch_all(conn)
    .await
    .during("reading which jobs have changed")?;
    let jobs = rows
        .iter()
        .map(|row| Ok((row.text("id")?, row.number("sequence")?)));
    Ok(JobVersions {
        newest,
        jobs: jobs.collect::<Result<_, StoreError>>()?,
    })
}
