//! Leases of workers that draw pictures of a render beside the worker that runs it.
//!
//! Such a lease is an attempt with a deadline. Its end never ends the job: its ranges go to others.

use super::leases::{Ask, gap};
use super::rows::{Columns, During};
use super::{attempts, jobs, outcome};
use crate::store::{Ending, LeaseKey, StoreError};
use sqlx::SqliteConnection;
use yoto_proto::v1::job;
use yoto_proto::v1::job_attempt::Outcome;

/// Lets the worker of `ask` help with a running render.
pub async fn begin(
    conn: &mut SqliteConnection,
    ask: &Ask<'_>,
    job_id: &str,
) -> Result<LeaseKey, StoreError> {
    let row = sqlx::query(
        "UPDATE jobs SET last_token = last_token + ?2, sequence = sequence + 1
         WHERE id = ?1 RETURNING last_token",
    )
    .bind(job_id)
    .bind(gap())
    .fetch_one(&mut *conn)
    .await
    .during("leasing a part of a render")?;
    let key = LeaseKey {
        job_id: job_id.to_owned(),
        worker_id: ask.worker_id.to_owned(),
        token: row.number("last_token")?,
    };
    attempts::begin(conn, &key, ask.now).await?;
    sqlx::query(
        "UPDATE job_attempts SET lease_deadline = ?3, lease_request = ?4
         WHERE job = ?1 AND lease = ?2",
    )
    .bind(&key.job_id)
    .bind(key.column()?)
    .bind(ask.now + ask.lease_seconds)
    .bind((!ask.request_id.is_empty()).then_some(ask.request_id))
    .execute(conn)
    .await
    .during("leasing a part of a render")?;
    Ok(key)
}

/// The helper's lease of an earlier call with the same id, with a new deadline.
pub async fn again(
    conn: &mut SqliteConnection,
    ask: &Ask<'_>,
) -> Result<Option<LeaseKey>, StoreError> {
    let row = sqlx::query(
        "UPDATE job_attempts SET lease_deadline = ?3
         WHERE worker = ?1 AND lease_deadline IS NOT NULL AND lease_request = ?2
         RETURNING job, lease",
    )
    .bind(ask.worker_id)
    .bind(ask.request_id)
    .bind(ask.now + ask.lease_seconds)
    .fetch_optional(conn)
    .await
    .during("looking for the lease of an earlier call")?;
    row.map(|row| {
        Ok(LeaseKey {
            job_id: row.text("job")?,
            worker_id: ask.worker_id.to_owned(),
            token: row.number("lease")?,
        })
    })
    .transpose()
}

/// Extends a helper's lease. Returns whether the job is to be cancelled.
pub async fn heartbeat(
    conn: &mut SqliteConnection,
    lease: &LeaseKey,
    deadline: f64,
) -> Result<bool, StoreError> {
    let row = sqlx::query(
        "UPDATE job_attempts SET lease_deadline = ?4
         WHERE job = ?1 AND lease = ?2 AND worker = ?3 AND lease_deadline IS NOT NULL
         RETURNING (SELECT cancel_requested FROM jobs WHERE id = ?1) AS cancel_requested",
    )
    .bind(&lease.job_id)
    .bind(lease.column()?)
    .bind(&lease.worker_id)
    .bind(deadline)
    .fetch_optional(&mut *conn)
    .await
    .during("recording a heartbeat")?;
    match row {
        Some(row) => row.flag("cancel_requested"),
        None => Err(lease.stale()),
    }
}

/// Whether this is a current helper's lease.
async fn lasts(conn: &mut SqliteConnection, lease: &LeaseKey) -> Result<bool, StoreError> {
    sqlx::query(
        "SELECT EXISTS (SELECT 1 FROM job_attempts
             WHERE job = ?1 AND lease = ?2 AND worker = ?3 AND lease_deadline IS NOT NULL) AS found",
    )
    .bind(&lease.job_id)
    .bind(lease.column()?)
    .bind(&lease.worker_id)
    .fetch_one(conn)
    .await
    .during("checking a lease")?
    .flag("found")
}

/// Ends a helper's lease. Returns false if this is not a current helper's lease.
pub async fn end(
    conn: &mut SqliteConnection,
    lease: &LeaseKey,
    ending: &Ending,
    now: f64,
) -> Result<bool, StoreError> {
    if !lasts(conn, lease).await? {
        return Ok(false);
    }
    if matches!(ending, Ending::Cancelled) && !jobs::cancel_requested(conn, &lease.job_id).await? {
        return Err(outcome::not_requested());
    }
    let (outcome, error) = match ending {
        Ending::Succeeded(_) => (Outcome::Helped, None),
        Ending::Failed(error) | Ending::Postponed(error) => (ending.outcome(), Some(error)),
        Ending::Cancelled | Ending::Returned => (ending.outcome(), None),
    };
    attempts::end(conn, lease, outcome, error, now).await?;
    changed(conn, &lease.job_id).await?;
    Ok(true)
}

/// Ends the lease of a helper that was lost. Returns false if it has ended already.
pub async fn lose(
    conn: &mut SqliteConnection,
    lease: &LeaseKey,
    now: f64,
) -> Result<bool, StoreError> {
    if !lasts(conn, lease).await? {
        return Ok(false);
    }
    attempts::end(conn, lease, Outcome::Lost, None, now).await?;
    sqlx::query("UPDATE jobs SET lost_workers = lost_workers + 1 WHERE id = ?1")
        .bind(&lease.job_id)
        .execute(&mut *conn)
        .await
        .during("counting a lost worker")?;
    changed(conn, &lease.job_id).await?;
    Ok(true)
}

/// Ends the leases of all helpers of a job that has ended in `state`, and forgets its ranges.
pub async fn dismiss(
    conn: &mut SqliteConnection,
    job_id: &str,
    state: job::State,
    now: f64,
) -> Result<(), StoreError> {
    let outcome = match state {
        job::State::Succeeded => Outcome::Helped,
        _ => Outcome::Cancelled,
    };
    sqlx::query(
        "UPDATE job_attempts SET end_time = ?2, outcome = ?3, lease_deadline = NULL
         WHERE job = ?1 AND lease_deadline IS NOT NULL",
    )
    .bind(job_id)
    .bind(now)
    .bind(outcome.as_str_name())
    .execute(&mut *conn)
    .await
    .during("ending the leases of a render's helpers")?;
    sqlx::query("DELETE FROM render_ranges WHERE job = ?1")
        .bind(job_id)
        .execute(conn)
        .await
        .during("forgetting the ranges of a render")?;
    Ok(())
}

/// Only the attempts of the job have changed.
async fn changed(conn: &mut SqliteConnection, job_id: &str) -> Result<(), StoreError> {
    sqlx::query("UPDATE jobs SET sequence = sequence + 1 WHERE id = ?1")
        .bind(job_id)
        .execute(conn)
        .await
        .during("recording the end of an attempt")?;
    Ok(())
}
