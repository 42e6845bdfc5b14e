//! Ends of leases, and their effect on the catalogue.
//!
//! An ingest job and its capture change in one transaction, as do an evaluate job and its
//! checkpoint's trade-off, so that the two never contradict each other.

use super::leases::{self, bound, guarded};
use super::rows::{Columns, During};
use super::{attempts, captures, checkpoints, helpers, jobs};
use crate::rules::retries;
use crate::store::{Ending, LeaseKey, StoreError};
use prost::Message;
use sqlx::SqliteConnection;
use sqlx::sqlite::SqliteRow;
use yoto_proto::v1::job_attempt::Outcome;
use yoto_proto::v1::{ErrorReason, JobError, JobResult, Progress, Violation, job, job_result};

/// Ends a lease. A repeated call with the same ending is accepted: the answer to the first was lost.
pub async fn end(
    conn: &mut SqliteConnection,
    lease: &LeaseKey,
    ending: Ending,
    now: f64,
) -> Result<(), StoreError> {
    let Some(cancel_requested) = cancel_requested(conn, lease).await? else {
        if helpers::end(conn, lease, &ending, now).await? {
            return Ok(());
        }
        return match attempts::outcome(conn, lease).await? {
            Some(ended) if is_repeat(ended, &ending) => Ok(()),
            _ => Err(leases::refusal(conn, lease).await),
        };
    };
    match ending {
        Ending::Succeeded(result) => complete(conn, lease, result, now).await,
        Ending::Failed(error) => fail(conn, lease, error, now).await,
        Ending::Cancelled if !cancel_requested => Err(not_requested()),
        Ending::Cancelled => cancel(conn, lease, now).await,
        Ending::Returned | Ending::Postponed(_) if cancel_requested => {
            cancel(conn, lease, now).await
        }
        Ending::Returned => requeue(conn, lease, Outcome::Returned, now).await,
        Ending::Postponed(error) => postpone(conn, lease, error, now).await,
    }
}

/// The refusal of a cancel that was not requested.
pub fn not_requested() -> StoreError {
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
async fn cancel_requested(
    conn: &mut SqliteConnection,
    lease: &LeaseKey,
) -> Result<Option<bool>, StoreError> {
    let row = bound(guarded!("SELECT cancel_requested FROM jobs"), lease)?
        .fetch_optional(&mut *conn)
        .await
        .during("checking a lease")?;
    row.map(|row| row.flag("cancel_requested")).transpose()
}

/// Ends the job with its result.
async fn complete(
    conn: &mut SqliteConnection,
    lease: &LeaseKey,
    result: JobResult,
    now: f64,
) -> Result<(), StoreError> {
    let end = End {
        state: job::State::Succeeded,
        outcome: Outcome::Succeeded,
        result: Some(&result),
        error: None,
    };
    let row = finish(conn, lease, end, now).await?;
    end_progress(conn, &lease.job_id).await?;
    if let (Some(capture), Some(job_result::Kind::Ingest(ingest))) =
        (row.maybe_text("capture")?, &result.kind)
    {
        captures::accept(conn, &capture, ingest).await?;
    }
    if let Some(job_result::Kind::Evaluate(evaluate)) = &result.kind
        && let Some(object) = &evaluate.tradeoff
    {
        checkpoints::record_tradeoff(conn, &evaluate.checkpoint, object).await?;
    }
    Ok(())
}

/// Sets the progress of a succeeded job to complete: the last heartbeat came before the end.
async fn end_progress(conn: &mut SqliteConnection, job_id: &str) -> Result<(), StoreError> {
    let progress = Progress {
        phase: "done".into(),
        fraction: 1.0,
        seconds_left: 0.0,
        ..jobs::get(conn, job_id).await?.progress.unwrap_or_default()
    };
    sqlx::query("UPDATE jobs SET progress = ?2 WHERE id = ?1")
        .bind(job_id)
        .bind(progress.encode_to_vec())
        .execute(conn)
        .await
        .during("ending a job's progress")?;
    Ok(())
}

/// Ends the leased job as FAILED.
pub async fn fail(
    conn: &mut SqliteConnection,
    lease: &LeaseKey,
    error: JobError,
    now: f64,
) -> Result<(), StoreError> {
    fail_after(conn, lease, error, Outcome::Failed, now).await
}

/// Ends the leased job as FAILED; `outcome` is that of its last attempt.
pub async fn fail_after(
    conn: &mut SqliteConnection,
    lease: &LeaseKey,
    error: JobError,
    outcome: Outcome,
    now: f64,
) -> Result<(), StoreError> {
    let end = End {
        state: job::State::Failed,
        outcome,
        result: None,
        error: Some(&error),
    };
    let row = finish(conn, lease, end, now).await?;
    end_ingest(conn, &row, &error.violations).await
}

/// Ends the leased job as CANCELLED.
pub async fn cancel(
    conn: &mut SqliteConnection,
    lease: &LeaseKey,
    now: f64,
) -> Result<(), StoreError> {
    let end = End {
        state: job::State::Cancelled,
        outcome: Outcome::Cancelled,
        result: None,
        error: None,
    };
    let row = finish(conn, lease, end, now).await?;
    end_ingest(conn, &row, &[]).await
}

/// Returns the leased job to its old position in the queue; `outcome` is that of the attempt.
pub async fn requeue(
    conn: &mut SqliteConnection,
    lease: &LeaseKey,
    outcome: Outcome,
    now: f64,
) -> Result<(), StoreError> {
    let statement = guarded!(
        "UPDATE jobs SET state = 'QUEUED', lease_deadline = NULL, sequence = sequence + 1"
    );
    let done = bound(statement, lease)?
        .execute(&mut *conn)
        .await
        .during("putting a job back into the queue")?;
    if done.rows_affected() == 0 {
        return Err(leases::refusal(conn, lease).await);
    }
    stand_still(conn, &lease.job_id).await?;
    attempts::end(conn, lease, outcome, None, now).await
}

/// Returns the leased job to the queue for a later attempt, with the reason for the wait, or ends it as FAILED
/// after too many retries.
async fn postpone(
    conn: &mut SqliteConnection,
    lease: &LeaseKey,
    mut error: JobError,
    now: f64,
) -> Result<(), StoreError> {
    let row = sqlx::query("SELECT retries FROM jobs WHERE id = ?1")
        .bind(&lease.job_id)
        .fetch_one(&mut *conn)
        .await
        .during("counting the retries of a job")?;
    let Some(wait) = retries::wait(row.number("retries")?) else {
        error.message = format!(
            "{} (after {} retries; the upload is not at fault)",
            error.message,
            retries::MAX_RETRIES
        );
        return fail(conn, lease, error, now).await;
    };
    let statement = guarded!(
        "UPDATE jobs SET state = 'QUEUED', lease_deadline = NULL, sequence = sequence + 1,
             retries = retries + 1, not_before = ?4, waiting_error = ?5"
    );
    let done = bound(statement, lease)?
        .bind(now + wait)
        .bind(error.encode_to_vec())
        .execute(&mut *conn)
        .await
        .during("putting a job back for later")?;
    if done.rows_affected() == 0 {
        return Err(leases::refusal(conn, lease).await);
    }
    stand_still(conn, &lease.job_id).await?;
    attempts::end(conn, lease, Outcome::Postponed, Some(&error), now).await
}

/// Removes speed and time left from the progress of a job without a worker: they are those of the last worker.
async fn stand_still(conn: &mut SqliteConnection, job_id: &str) -> Result<(), StoreError> {
    let Some(progress) = jobs::get(conn, job_id).await?.progress else {
        return Ok(());
    };
    let progress = Progress {
        steps_per_second: 0.0,
        seconds_left: 0.0,
        ..progress
    };
    sqlx::query("UPDATE jobs SET progress = ?2 WHERE id = ?1")
        .bind(job_id)
        .bind(progress.encode_to_vec())
        .execute(conn)
        .await
        .during("stopping a job's progress")?;
    Ok(())
}

/// Ends a job without a worker.
pub async fn cancel_queued(
    conn: &mut SqliteConnection,
    job_id: &str,
    now: f64,
) -> Result<(), StoreError> {
    let row = sqlx::query(
        "UPDATE jobs SET state = 'CANCELLED', cancel_requested = 1, sequence = sequence + 1,
             end_time = ?2, waiting_error = NULL, not_before = NULL
         WHERE id = ?1 AND state = 'QUEUED' RETURNING capture",
    )
    .bind(job_id)
    .bind(now)
    .fetch_optional(&mut *conn)
    .await
    .during("cancelling a queued job")?;
    match row {
        Some(row) => {
            helpers::dismiss(conn, job_id, job::State::Cancelled, now).await?;
            end_ingest(conn, &row, &[]).await
        }
        None => Ok(()),
    }
}

/// Updates the capture of an ingest job that ended without a result; other jobs have no capture. Only a fault
/// in its files rejects it.
async fn end_ingest(
    conn: &mut SqliteConnection,
    job: &SqliteRow,
    violations: &[Violation],
) -> Result<(), StoreError> {
    match job.maybe_text("capture")? {
        Some(capture) if violations.is_empty() => captures::put_back(conn, &capture).await,
        Some(capture) => captures::reject(conn, &capture, violations).await,
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
async fn finish(
    conn: &mut SqliteConnection,
    lease: &LeaseKey,
    end: End<'_>,
    now: f64,
) -> Result<SqliteRow, StoreError> {
    let statement = guarded!(
        "UPDATE jobs SET state = ?4, result = ?5, error = ?6, lease_deadline = NULL,
             sequence = sequence + 1, end_time = ?7",
        "RETURNING capture"
    );
    let row = bound(statement, lease)?
        .bind(end.state.as_str_name())
        .bind(end.result.map(Message::encode_to_vec))
        .bind(end.error.map(Message::encode_to_vec))
        .bind(now)
        .fetch_optional(&mut *conn)
        .await
        .during("ending a job")?;
    let Some(row) = row else {
        return Err(leases::refusal(conn, lease).await);
    };
    attempts::end(conn, lease, end.outcome, end.error, now).await?;
    helpers::dismiss(conn, &lease.job_id, end.state, now).await?;
    Ok(row)
}
