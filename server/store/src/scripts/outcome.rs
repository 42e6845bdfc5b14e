//! Ends of leases, and their effect on the catalogue.
//!
//! An ingest job and its capture change in one transaction, as do an evaluate job and its
//! checkpoint's trade-off, so that the two never contradict each other.

use super::leases::{bound, guarded};
use super::{attempts, captures, checkpoints, helpers, jobs, webhooks};
use crate::db::{Row, Tx, sql};
use crate::rules::retries;
use crate::{Ending, LeaseKey, StoreError, Tenant};
use prost::Message;
use yoto_proto::v1::job_attempt::Outcome;
use yoto_proto::v1::{ErrorReason, JobError, JobResult, Progress, Violation, job, job_result};

/// Ends a lease. A repeated call with the same ending is accepted: the answer to the first was lost.
pub(crate) async fn end(
    tx: &mut Tx,
    tenant: &Tenant,
    lease: &LeaseKey,
    ending: Ending,
) -> Result<(), StoreError> {
    let Some(cancel_requested) = cancel_requested(tx, lease).await? else {
        if helpers::end(tx, lease, &ending).await? {
            return Ok(());
        }
        return match attempts::outcome(tx, lease).await? {
            Some(ended) if is_repeat(ended, &ending) => Ok(()),
            _ => Err(lease.stale()),
        };
    };
    match ending {
        Ending::Succeeded(result) => complete(tx, tenant, lease, result).await,
        Ending::Failed(error) => fail(tx, lease, error).await,
        Ending::Cancelled if !cancel_requested => Err(not_requested()),
        Ending::Cancelled => cancel(tx, lease).await,
        Ending::Returned | Ending::Postponed(_) if cancel_requested => cancel(tx, lease).await,
        Ending::Returned => requeue(tx, lease, Outcome::Returned).await,
        Ending::Postponed(error) => postpone(tx, lease, error).await,
    }
}

/// The refusal of a cancel that was not requested.
pub(crate) fn not_requested() -> StoreError {
    StoreError::Rule {
        reason: ErrorReason::CancelNotRequested,
        message: "no cancel of this job was requested".into(),
    }
}

/// Whether an attempt with the outcome `ended` may come from this `ending`: a cancel, or too many retries, can
/// change the outcome.
fn is_repeat(ended: Outcome, ending: &Ending) -> bool {
    let asked = ending.outcome();
    ended == asked
        || (ended == Outcome::Cancelled && matches!(asked, Outcome::Returned | Outcome::Postponed))
        || (ended == Outcome::Failed && asked == Outcome::Postponed)
        || (ended == Outcome::Helped && asked == Outcome::Succeeded)
}

/// Whether a cancel of the leased job was requested; `None` if the lease is stale.
async fn cancel_requested(tx: &mut Tx, lease: &LeaseKey) -> Result<Option<bool>, StoreError> {
    let row = bound(guarded!("SELECT cancel_requested FROM jobs"), lease)?
        .row(tx, "checking a lease")
        .await?;
    row.map(|row| row.flag("cancel_requested")).transpose()
}

/// Ends the job with its result.
async fn complete(
    tx: &mut Tx,
    tenant: &Tenant,
    lease: &LeaseKey,
    result: JobResult,
) -> Result<(), StoreError> {
    let end = End {
        state: job::State::Succeeded,
        outcome: Outcome::Succeeded,
        result: Some(&result),
        error: None,
    };
    let row = finish(tx, lease, end).await?;
    end_progress(tx, &lease.job_id).await?;
    if let (Some(capture), Some(job_result::Kind::Ingest(ingest))) =
        (row.maybe_text("capture")?, &result.kind)
    {
        captures::accept(tx, &capture, ingest).await?;
    }
    if let Some(job_result::Kind::Evaluate(evaluate)) = &result.kind
        && let Some(object) = &evaluate.tradeoff
    {
        checkpoints::record_tradeoff(tx, tenant, &evaluate.checkpoint, object).await?;
    }
    Ok(())
}

/// Sets the progress of a succeeded job to complete: the last heartbeat came before the end.
async fn end_progress(tx: &mut Tx, job_id: &str) -> Result<(), StoreError> {
    let progress = Progress {
        phase: "done".into(),
        fraction: 1.0,
        seconds_left: Some(0.0),
        ..jobs::progress(tx, job_id).await?.unwrap_or_default()
    };
    sql("UPDATE jobs SET progress = $2 WHERE id = $1")
        .bind(job_id)
        .bind(progress.encode_to_vec())
        .execute(tx, "ending a job's progress")
        .await?;
    Ok(())
}

/// Ends the leased job as FAILED.
pub(crate) async fn fail(tx: &mut Tx, lease: &LeaseKey, error: JobError) -> Result<(), StoreError> {
    fail_after(tx, lease, error, Outcome::Failed).await
}

/// Ends the leased job as FAILED; `outcome` is that of its last attempt.
pub(crate) async fn fail_after(
    tx: &mut Tx,
    lease: &LeaseKey,
    error: JobError,
    outcome: Outcome,
) -> Result<(), StoreError> {
    let end = End {
        state: job::State::Failed,
        outcome,
        result: None,
        error: Some(&error),
    };
    let row = finish(tx, lease, end).await?;
    end_ingest(tx, &row, &error.violations).await
}

/// Ends the leased job as CANCELLED.
pub(crate) async fn cancel(tx: &mut Tx, lease: &LeaseKey) -> Result<(), StoreError> {
    let end = End {
        state: job::State::Cancelled,
        outcome: Outcome::Cancelled,
        result: None,
        error: None,
    };
    let row = finish(tx, lease, end).await?;
    end_ingest(tx, &row, &[]).await
}

/// Returns the leased job to its old position in the queue; `outcome` is that of the attempt.
pub(crate) async fn requeue(
    tx: &mut Tx,
    lease: &LeaseKey,
    outcome: Outcome,
) -> Result<(), StoreError> {
    let statement = guarded!(
        "UPDATE jobs SET state = 'QUEUED', lease_deadline = NULL, sequence = sequence + 1"
    );
    let done = bound(statement, lease)?
        .execute(tx, "putting a job back into the queue")
        .await?;
    if done == 0 {
        return Err(lease.stale());
    }
    stand_still(tx, &lease.job_id).await?;
    attempts::end(tx, lease, outcome, None).await
}

/// Returns the leased job to the queue for a later attempt, with the reason for the wait, or ends it as FAILED
/// after too many retries.
async fn postpone(tx: &mut Tx, lease: &LeaseKey, mut error: JobError) -> Result<(), StoreError> {
    let row = sql("SELECT retries FROM jobs WHERE id = $1")
        .bind(&lease.job_id)
        .one(tx, "counting the retries of a job")
        .await?;
    let Some(wait) = retries::wait(row.number("retries")?) else {
        error.message = format!(
            "{} (after {} retries; the upload is not at fault)",
            error.message,
            retries::MAX_RETRIES
        );
        return fail(tx, lease, error).await;
    };
    let statement = guarded!(
        "UPDATE jobs SET state = 'QUEUED', lease_deadline = NULL, sequence = sequence + 1,
             retries = retries + 1, not_before = $4, waiting_error = $5"
    );
    let done = bound(statement, lease)?
        .bind(tx.now() + wait)
        .bind(error.encode_to_vec())
        .execute(tx, "putting a job back for later")
        .await?;
    if done == 0 {
        return Err(lease.stale());
    }
    stand_still(tx, &lease.job_id).await?;
    attempts::end(tx, lease, Outcome::Postponed, Some(&error)).await
}

/// Removes speed and time left from the progress of a job without a worker: they are those of the last worker.
async fn stand_still(tx: &mut Tx, job_id: &str) -> Result<(), StoreError> {
    let Some(progress) = jobs::progress(tx, job_id).await? else {
        return Ok(());
    };
    let progress = Progress {
        steps_per_second: 0.0,
        seconds_left: None,
        ..progress
    };
    sql("UPDATE jobs SET progress = $2 WHERE id = $1")
        .bind(job_id)
        .bind(progress.encode_to_vec())
        .execute(tx, "stopping a job's progress")
        .await?;
    Ok(())
}

/// Ends a job without a worker. Returns false if it is not QUEUED.
pub(crate) async fn cancel_queued(tx: &mut Tx, job_id: &str) -> Result<bool, StoreError> {
    let row = sql(
        "UPDATE jobs SET state = 'CANCELLED', cancel_requested = 1, sequence = sequence + 1,
             end_time = CASE WHEN $2 < coalesce(start_time, create_time)
                 THEN coalesce(start_time, create_time) ELSE $2 END, waiting_error = NULL, not_before = NULL
         WHERE id = $1 AND state = 'QUEUED' RETURNING capture",
    )
    .bind(job_id)
    .bind(tx.now())
    .row(tx, "cancelling a queued job")
    .await?;
    let Some(row) = row else {
        return Ok(false);
    };
    helpers::dismiss(tx, job_id, job::State::Cancelled).await?;
    webhooks::job_ended(tx, job_id).await?;
    end_ingest(tx, &row, &[]).await?;
    Ok(true)
}

/// Ends a job without a worker as FAILED. Returns false if it is not QUEUED.
pub(crate) async fn fail_queued(
    tx: &mut Tx,
    job_id: &str,
    error: &JobError,
) -> Result<bool, StoreError> {
    let done = sql(
        "UPDATE jobs SET state = 'FAILED', error = $3, sequence = sequence + 1,
             end_time = CASE WHEN $2 < coalesce(start_time, create_time)
                 THEN coalesce(start_time, create_time) ELSE $2 END, waiting_error = NULL, not_before = NULL
         WHERE id = $1 AND state = 'QUEUED' AND kind <> 'ingest'",
    )
    .bind(job_id)
    .bind(tx.now())
    .bind(error.encode_to_vec())
    .execute(tx, "ending a queued job")
    .await?;
    if done == 0 {
        return Ok(false);
    }
    helpers::dismiss(tx, job_id, job::State::Failed).await?;
    webhooks::job_ended(tx, job_id).await?;
    Ok(true)
}

/// Ends the leased job as CANCELLED because of `error`, without waiting for its worker, whose lease is stale from now on.
pub(crate) async fn stop(
    tx: &mut Tx,
    lease: &LeaseKey,
    error: &JobError,
) -> Result<(), StoreError> {
    let end = End {
        state: job::State::Cancelled,
        outcome: Outcome::Cancelled,
        result: None,
        error: Some(error),
    };
    let row = finish(tx, lease, end).await?;
    end_ingest(tx, &row, &[]).await
}

/// Updates the capture of an ingest job that ended without a result; other jobs have no capture. Only a fault
/// in its files rejects it.
async fn end_ingest(tx: &mut Tx, job: &Row, violations: &[Violation]) -> Result<(), StoreError> {
    match job.maybe_text("capture")? {
        Some(capture) if violations.is_empty() => captures::put_back(tx, &capture).await,
        Some(capture) => captures::reject(tx, &capture, violations).await,
        None => Ok(()),
    }
}

/// A terminal state, and how the last attempt ended.
struct End<'a> {
    state: job::State,
    outcome: Outcome,
    result: Option<&'a JobResult>,
    error: Option<&'a JobError>,
}

/// The guarded write of a terminal state. Returns the job's `capture` column.
async fn finish(tx: &mut Tx, lease: &LeaseKey, end: End<'_>) -> Result<Row, StoreError> {
    let statement = guarded!(
        "UPDATE jobs SET state = $4, result = $5, error = $6, lease_deadline = NULL,
             sequence = sequence + 1, end_time = CASE WHEN $7 < coalesce(start_time, create_time)
                 THEN coalesce(start_time, create_time) ELSE $7 END",
        "RETURNING capture"
    );
    let row = bound(statement, lease)?
        .bind(end.state.as_str_name())
        .bind(end.result.map(Message::encode_to_vec))
        .bind(end.error.map(Message::encode_to_vec))
        .bind(tx.now())
        .row(tx, "ending a job")
        .await?;
    let Some(row) = row else {
        return Err(lease.stale());
    };
    attempts::end(tx, lease, end.outcome, end.error).await?;
    helpers::dismiss(tx, &lease.job_id, end.state).await?;
    webhooks::job_ended(tx, &lease.job_id).await?;
    Ok(row)
}
