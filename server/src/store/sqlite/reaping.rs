//! Jobs of silent workers.
//!
//! A lost worker is not the job's fault, so the job goes back to the queue; but a job that
//! crashes one worker after another must end.

use super::{
    outcome,
    rows::{Columns, During},
};
use crate::store::{LeaseKey, Reaped, StoreError};
use sqlx::{Row, SqliteConnection};
use yoto_proto::{
    names::Collection,
    v1::{JobError, job},
};

/// Whether any lease has expired.
pub async fn any_expired(conn: &mut SqliteConnection) -> Result<bool, StoreError> {
    sqlx::query(
        "SELECT EXISTS (SELECT 1 FROM jobs
             WHERE state = 'RUNNING' AND lease_deadline < unixepoch('subsec'))",
    )
    .fetch_one(conn)
    .await
    .and_then(|row| row.try_get(0))
    .during("looking for expired leases")
}

/// Takes back every job with an expired lease.
pub async fn reap(conn: &mut SqliteConnection, cap: u32) -> Result<Vec<Reaped>, StoreError> {
    let rows = sqlx::query(
        "SELECT id, lease, worker, lost_workers, cancel_requested FROM jobs
         WHERE state = 'RUNNING' AND lease_deadline < unixepoch('subsec') ORDER BY ord",
    )
    .fetch_all(&mut *conn)
    .await
    .during("reading jobs with expired leases")?;
    let mut reaped = Vec::with_capacity(rows.len());
    for row in &rows {
        let lease = LeaseKey {
            job_id: row.text("id")?,
            token: row.number("lease")?,
        };
        let worker = Collection::Workers.name(&row.maybe_text("worker")?.unwrap_or_default());
        let lost_workers: u32 = row.number::<u32>("lost_workers")?.saturating_add(1);
        count_lost_worker(conn, &lease.job_id).await?;
        let state = if row.flag("cancel_requested")? {
            outcome::cancel(conn, &lease).await?;
            job::State::Cancelled
        } else if lost_workers >= cap {
            let message = format!(
                "{lost_workers} workers went silent while they ran this job, the last {worker}"
            );
            let error = JobError {
                code: "WORKERS_LOST".into(),
                message,
                violations: Vec::new(),
            };
            outcome::fail(conn, &lease, error).await?;
            job::State::Failed
        } else {
            outcome::requeue(conn, &lease).await?;
            job::State::Queued
        };
        let job = Collection::Jobs.name(&lease.job_id);
        reaped.push(Reaped {
            job,
            worker,
            lost_workers,
            state,
        });
    }
    Ok(reaped)
}

/// The change of state that follows in the same transaction increases the sequence number.
async fn count_lost_worker(conn: &mut SqliteConnection, job_id: &str) -> Result<(), StoreError> {
    sqlx::query("UPDATE jobs SET lost_workers = lost_workers + 1 WHERE id = ?1")
        .bind(job_id)
        .execute(conn)
        .await
        .during("counting a lost worker")?;
    Ok(())
}
