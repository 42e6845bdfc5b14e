//! Leases of workers that draw pictures of a render beside the worker that runs it.
//!
//! Such a lease is an attempt with a deadline. Its end never ends the job: its ranges go to others.

use super::leases::{Ask, begin_attempt, gap};
use super::{attempts, jobs, outcome};
use crate::db::{Tx, sql};
use crate::{Ending, LeaseKey, StoreError};
use yoto_proto::v1::job;
use yoto_proto::v1::job_attempt::Outcome;

/// Lets the worker of `ask` help with a running render; `None` if it has ended, or is to be cancelled.
pub(crate) async fn begin(
    tx: &mut Tx,
    ask: &Ask<'_>,
    job_id: &str,
) -> Result<Option<LeaseKey>, StoreError> {
    let row = sql(
        "UPDATE jobs SET last_token = last_token + $2, sequence = sequence + 1
         WHERE id = $1 AND state = 'RUNNING' AND cancel_requested = 0 RETURNING last_token AS lease",
    )
    .bind(job_id)
    .bind(gap())
    .row(tx, "leasing a part of a render")
    .await?;
    let Some(key) = begin_attempt(tx, ask, job_id, row).await? else {
        return Ok(None);
    };
    sql(
        "UPDATE job_attempts SET lease_deadline = $3, lease_request = $4
         WHERE job = $1 AND lease = $2",
    )
    .bind(&key.job_id)
    .bind(key.column()?)
    .bind(tx.now() + ask.lease_seconds)
    .bind((!ask.request_id.is_empty()).then_some(ask.request_id))
    .execute(tx, "leasing a part of a render")
    .await?;
    Ok(Some(key))
}

/// The helper's lease of an earlier call with the same id, with a new deadline.
pub(crate) async fn again(tx: &mut Tx, ask: &Ask<'_>) -> Result<Option<LeaseKey>, StoreError> {
    let row = sql("UPDATE job_attempts SET lease_deadline = $3
         WHERE worker = $1 AND lease_deadline IS NOT NULL AND lease_request = $2
         RETURNING job, lease")
    .bind(ask.worker_id)
    .bind(ask.request_id)
    .bind(tx.now() + ask.lease_seconds)
    .row(tx, "looking for the lease of an earlier call")
    .await?;
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
pub(crate) async fn heartbeat(
    tx: &mut Tx,
    lease: &LeaseKey,
    lease_seconds: f64,
) -> Result<bool, StoreError> {
    let row = sql("UPDATE job_attempts SET lease_deadline = $4
         WHERE job = $1 AND lease = $2 AND worker = $3 AND lease_deadline IS NOT NULL
         RETURNING (SELECT cancel_requested FROM jobs WHERE id = $1) AS cancel_requested")
    .bind(&lease.job_id)
    .bind(lease.column()?)
    .bind(&lease.worker_id)
    .bind(tx.now() + lease_seconds)
    .row(tx, "recording a heartbeat")
    .await?;
    match row {
        Some(row) => row.flag("cancel_requested"),
        None => Err(lease.stale()),
    }
}

/// Whether this is a current helper's lease.
async fn lasts(tx: &mut Tx, lease: &LeaseKey) -> Result<bool, StoreError> {
    sql(
        "SELECT EXISTS (SELECT 1 FROM job_attempts
             WHERE job = $1 AND lease = $2 AND worker = $3 AND lease_deadline IS NOT NULL) AS found",
    )
    .bind(&lease.job_id)
    .bind(lease.column()?)
    .bind(&lease.worker_id)
    .one(tx, "checking a lease").await?
    .flag("found")
}

/// Ends a helper's lease. Returns false if this is not a current helper's lease.
pub(crate) async fn end(
    tx: &mut Tx,
    lease: &LeaseKey,
    ending: &Ending,
) -> Result<bool, StoreError> {
    if !lasts(tx, lease).await? {
        return Ok(false);
    }
    if matches!(ending, Ending::Cancelled) && !jobs::cancel_requested(tx, &lease.job_id).await? {
        return Err(outcome::not_requested());
    }
    let (outcome, error) = match ending {
        Ending::Succeeded(_) => (Outcome::Helped, None),
        Ending::Failed(error) | Ending::Postponed(error) => (ending.outcome(), Some(error)),
        Ending::Cancelled | Ending::Returned => (ending.outcome(), None),
    };
    attempts::end(tx, lease, outcome, error).await?;
    changed(tx, &lease.job_id).await?;
    Ok(true)
}

/// Ends the lease of a helper that was lost. Returns false if it has ended already.
pub(crate) async fn lose(tx: &mut Tx, lease: &LeaseKey) -> Result<bool, StoreError> {
    if !lasts(tx, lease).await? {
        return Ok(false);
    }
    attempts::end(tx, lease, Outcome::Lost, None).await?;
    sql("UPDATE jobs SET lost_workers = lost_workers + 1 WHERE id = $1")
        .bind(&lease.job_id)
        .execute(tx, "counting a lost worker")
        .await?;
    changed(tx, &lease.job_id).await?;
    Ok(true)
}

/// Ends the leases of all helpers of a job that has ended in `state`, and forgets its ranges.
pub(crate) async fn dismiss(
    tx: &mut Tx,
    job_id: &str,
    state: job::State,
) -> Result<(), StoreError> {
    let outcome = match state {
        job::State::Succeeded => Outcome::Helped,
        _ => Outcome::Cancelled,
    };
    sql(
        "UPDATE job_attempts SET end_time = CASE WHEN $2 < begin_time THEN begin_time ELSE $2 END, outcome = $3, lease_deadline = NULL
         WHERE job = $1 AND lease_deadline IS NOT NULL",
    )
    .bind(job_id)
    .bind(tx.now())
    .bind(outcome.as_str_name())
    .execute(tx, "ending the leases of a render's helpers")
    .await?;
    sql("DELETE FROM render_ranges WHERE job = $1")
        .bind(job_id)
        .execute(tx, "forgetting the ranges of a render")
        .await?;
    Ok(())
}

/// Only the attempts of the job have changed.
async fn changed(tx: &mut Tx, job_id: &str) -> Result<(), StoreError> {
    sql("UPDATE jobs SET sequence = sequence + 1 WHERE id = $1")
        .bind(job_id)
        .execute(tx, "recording the end of an attempt")
        .await?;
    Ok(())
}
