//! Leases: the right to write to a job, with a deadline.
//!
//! The fencing token is the job's `lease` column. A write is guarded by the job's id, the
//! token and the state RUNNING; a worker that lost its lease matches no row.

use super::{
    checkpoints, jobs, pins,
    rows::{Columns, During, integer},
};
use crate::{
    checkpoints::retention::Retention,
    store::{LeaseKey, StoreError},
};
use prost::Message;
use sqlx::SqliteConnection;
use yoto_proto::{
    names::Collection,
    v1::{Checkpoint, Job, Progress},
};

/// Whether a job for the worker is queued. Workers ask often and mostly without success; this
/// read saves a transaction on the writer's connection, and a disk access, each time.
pub async fn any_queued(conn: &mut SqliteConnection, worker_id: &str) -> Result<bool, StoreError> {
    let row = sqlx::query(
        "SELECT EXISTS (
             SELECT 1 FROM jobs j JOIN worker_kinds k ON k.kind = j.kind
             WHERE j.state = 'QUEUED' AND k.worker = w.id
               AND (j.not_before IS NULL OR j.not_before <= unixepoch('subsec'))) AS waiting
         FROM workers w WHERE w.id = ?1",
    )
    .bind(worker_id)
    .fetch_optional(conn)
    .await
    .during("looking for a queued job")?;
    match row {
        Some(row) => row.flag("waiting"),
        None => Err(StoreError::NotFound {
            name: Collection::Workers.name(worker_id),
        }),
    }
}

/// Leases the oldest QUEUED job that the worker can run. A model has one trainer at a time.
pub async fn lease(
    conn: &mut SqliteConnection,
    worker_id: &str,
    lease_seconds: f64,
) -> Result<Option<Job>, StoreError> {
    let leased = sqlx::query(
        "UPDATE jobs SET state = 'RUNNING', lease = lease + 1, worker = ?1,
             lease_deadline = unixepoch('subsec') + ?2, sequence = sequence + 1,
             start_time = coalesce(start_time, unixepoch('subsec'))
         WHERE ord = (
             SELECT q.ord FROM jobs q
             WHERE q.state = 'QUEUED'
               AND (q.not_before IS NULL OR q.not_before <= unixepoch('subsec'))
               AND q.kind IN (SELECT kind FROM worker_kinds WHERE worker = ?1)
               AND NOT (q.kind = 'train' AND EXISTS (
                   SELECT 1 FROM jobs r
                   WHERE r.model = q.model AND r.kind = 'train' AND r.state = 'RUNNING'))
             ORDER BY q.ord LIMIT 1)
         RETURNING id",
    )
    .bind(worker_id)
    .bind(lease_seconds)
    .fetch_optional(&mut *conn)
    .await
    .during("leasing a job")?;
    let Some(row) = leased else {
        return Ok(None);
    };
    let id = row.text("id")?;
    let job = jobs::get(conn, &id).await?;
    if let Some(spec) = &job.spec {
        pins::renew(conn, &id, spec).await?;
    }
    Ok(Some(job))
}

/// The reason why a guarded write matched no row: the job does not exist, or the lease is stale.
pub async fn refusal(conn: &mut SqliteConnection, lease: &LeaseKey) -> StoreError {
    match jobs::get(conn, &lease.job_id).await {
        Ok(job) => StoreError::StaleLease {
            job: job.name,
            token: lease.token,
        },
        Err(error) => error,
    }
}

/// The token in the column's type. A token beyond the column's range was never issued.
pub fn token(lease: &LeaseKey) -> Result<i64, StoreError> {
    i64::try_from(lease.token).map_err(|_| StoreError::StaleLease {
        job: Collection::Jobs.name(&lease.job_id),
        token: lease.token,
    })
}

/// Extends the lease and records progress.
pub async fn heartbeat(
    conn: &mut SqliteConnection,
    lease: &LeaseKey,
    progress: Option<Progress>,
    lease_seconds: f64,
) -> Result<bool, StoreError> {
    let row = sqlx::query(
        "UPDATE jobs SET lease_deadline = unixepoch('subsec') + ?3,
             sequence = sequence + (?4 IS NOT NULL AND progress IS NOT ?4),
             progress = coalesce(?4, progress)
         WHERE id = ?1 AND lease = ?2 AND state = 'RUNNING'
         RETURNING cancel_requested",
    )
    .bind(&lease.job_id)
    .bind(token(lease)?)
    .bind(lease_seconds)
    .bind(progress.map(|progress| progress.encode_to_vec()))
    .fetch_optional(&mut *conn)
    .await
    .during("recording a heartbeat")?;
    match row {
        Some(row) => row.flag("cancel_requested"),
        None => Err(refusal(conn, lease).await),
    }
}

/// Records a checkpoint of the leased train job's model, and removes those that it no longer keeps.
pub async fn publish(
    conn: &mut SqliteConnection,
    lease: &LeaseKey,
    checkpoint: Checkpoint,
    default: Retention,
) -> Result<(), StoreError> {
    integer("checkpoint.step", checkpoint.step)?;
    // The transaction holds the write lock, so the lease can't change before the commit.
    let row = sqlx::query(
        "SELECT model FROM jobs
         WHERE id = ?1 AND lease = ?2 AND state = 'RUNNING' AND kind = 'train'",
    )
    .bind(&lease.job_id)
    .bind(token(lease)?)
    .fetch_optional(&mut *conn)
    .await
    .during("checking a lease")?;
    match row {
        Some(row) => {
            let model = row.text("model")?;
            checkpoints::record(conn, &model, &lease.job_id, checkpoint).await?;
            checkpoints::thin_out(conn, &model, default).await
        }
        None => Err(refusal(conn, lease).await),
    }
}
