//! Outcomes of jobs, and their effect on the catalogue.
//!
//! An ingest job and its capture change in one transaction, as do an evaluate job and its
//! checkpoint's trade-off, so that the two never contradict each other.

use super::{captures, checkpoints, jobs, leases, rows::Columns, rows::During};
use crate::store::{Ending, LeaseKey, StoreError};
use prost::Message;
use sqlx::{SqliteConnection, sqlite::SqliteRow};
use yoto_proto::v1::{JobError, JobResult, Progress, Violation, job, job_result};

/// Number of retries after faults outside the job: over about a day, so that a store or a
/// machine can be repaired meanwhile.
const MAX_RETRIES: i64 = 100;
/// Longest wait before a retry; the first wait is a second, and each later one doubles.
const LONGEST_WAIT_SECONDS: i64 = 900;
/// Doublings of the wait; more would overflow before the longest wait is taken.
const MAX_DOUBLINGS: i64 = 20;

/// Ends the job with its result.
pub async fn complete(
    conn: &mut SqliteConnection,
    lease: &LeaseKey,
    result: JobResult,
) -> Result<(), StoreError> {
    let row = finish(conn, lease, job::State::Succeeded, Some(&result), None).await?;
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

/// Sets the progress of a job that succeeded to its end: the last heartbeat came before it.
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

/// Ends the job without a result, or puts it back into the queue.
pub async fn end(
    conn: &mut SqliteConnection,
    lease: &LeaseKey,
    ending: Ending,
) -> Result<(), StoreError> {
    let cancel_requested = cancel_requested(conn, lease).await?;
    match ending {
        Ending::Failed(error) => fail(conn, lease, error).await,
        Ending::Cancelled if cancel_requested => cancel(conn, lease).await,
        Ending::Cancelled => Err(StoreError::Rule {
            reason: "CANCEL_NOT_REQUESTED",
            message: "no cancel of this job was requested".into(),
        }),
        Ending::Requeued if cancel_requested => cancel(conn, lease).await,
        Ending::Requeued => requeue(conn, lease).await,
        Ending::TryLater(_) if cancel_requested => cancel(conn, lease).await,
        Ending::TryLater(error) => try_later(conn, lease, error).await,
    }
}

async fn cancel_requested(
    conn: &mut SqliteConnection,
    lease: &LeaseKey,
) -> Result<bool, StoreError> {
    let row = sqlx::query(
        "SELECT cancel_requested FROM jobs WHERE id = ?1 AND lease = ?2 AND state = 'RUNNING'",
    )
    .bind(&lease.job_id)
    .bind(leases::token(lease)?)
    .fetch_optional(&mut *conn)
    .await
    .during("checking a lease")?;
    match row {
        Some(row) => row.flag("cancel_requested"),
        None => Err(leases::refusal(conn, lease).await),
    }
}

/// Ends the leased job as FAILED.
pub async fn fail(
    conn: &mut SqliteConnection,
    lease: &LeaseKey,
    error: JobError,
) -> Result<(), StoreError> {
    let row = finish(conn, lease, job::State::Failed, None, Some(&error)).await?;
    end_ingest(conn, &row, &error.violations).await
}

/// Ends the leased job as CANCELLED.
pub async fn cancel(conn: &mut SqliteConnection, lease: &LeaseKey) -> Result<(), StoreError> {
    let row = finish(conn, lease, job::State::Cancelled, None, None).await?;
    end_ingest(conn, &row, &[]).await
}

/// Returns the leased job to its old place in the queue.
pub async fn requeue(conn: &mut SqliteConnection, lease: &LeaseKey) -> Result<(), StoreError> {
    let done = sqlx::query(
        "UPDATE jobs SET state = 'QUEUED', lease_deadline = NULL, sequence = sequence + 1
         WHERE id = ?1 AND lease = ?2 AND state = 'RUNNING'",
    )
    .bind(&lease.job_id)
    .bind(leases::token(lease)?)
    .execute(&mut *conn)
    .await
    .during("putting a job back into the queue")?;
    if done.rows_affected() == 0 {
        return Err(leases::refusal(conn, lease).await);
    }
    Ok(())
}

/// Returns the leased job to the queue for later, or ends it as FAILED after
/// [`MAX_RETRIES`] retries.
async fn try_later(
    conn: &mut SqliteConnection,
    lease: &LeaseKey,
    mut error: JobError,
) -> Result<(), StoreError> {
    let done = sqlx::query(
        "UPDATE jobs SET state = 'QUEUED', lease_deadline = NULL, sequence = sequence + 1,
             retries = retries + 1,
             not_before = unixepoch('subsec') + min(1 << min(retries, ?5), ?3)
         WHERE id = ?1 AND lease = ?2 AND state = 'RUNNING' AND retries < ?4",
    )
    .bind(&lease.job_id)
    .bind(leases::token(lease)?)
    .bind(LONGEST_WAIT_SECONDS)
    .bind(MAX_RETRIES)
    .bind(MAX_DOUBLINGS)
    .execute(&mut *conn)
    .await
    .during("putting a job back for later")?;
    if done.rows_affected() > 0 {
        return Ok(());
    }
    error.message = format!(
        "{} (after {MAX_RETRIES} retries; the upload is not at fault)",
        error.message
    );
    fail(conn, lease, error).await
}

/// Ends a job without a worker.
pub async fn cancel_queued(conn: &mut SqliteConnection, job_id: &str) -> Result<(), StoreError> {
    let row = sqlx::query(
        "UPDATE jobs SET state = 'CANCELLED', cancel_requested = 1, sequence = sequence + 1,
             end_time = unixepoch('subsec')
         WHERE id = ?1 AND state = 'QUEUED' RETURNING capture",
    )
    .bind(job_id)
    .fetch_optional(&mut *conn)
    .await
    .during("cancelling a queued job")?;
    match row {
        Some(row) => end_ingest(conn, &row, &[]).await,
        None => Ok(()),
    }
}

/// What becomes of the capture of an ingest job without a result; other jobs have no capture. Only a
/// fault of its files rejects it.
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

/// The guarded write of a terminal state. Returns the job's `capture` column.
async fn finish(
    conn: &mut SqliteConnection,
    lease: &LeaseKey,
    state: job::State,
    result: Option<&JobResult>,
    error: Option<&JobError>,
) -> Result<SqliteRow, StoreError> {
    let row = sqlx::query(
        "UPDATE jobs SET state = ?3, result = ?4, error = ?5, lease_deadline = NULL,
             sequence = sequence + 1, end_time = unixepoch('subsec')
         WHERE id = ?1 AND lease = ?2 AND state = 'RUNNING' RETURNING capture",
    )
    .bind(&lease.job_id)
    .bind(leases::token(lease)?)
    .bind(state.as_str_name())
    .bind(result.map(Message::encode_to_vec))
    .bind(error.map(Message::encode_to_vec))
    .fetch_optional(&mut *conn)
    .await
    .during("ending a job")?;
    match row {
        Some(row) => Ok(row),
        None => Err(leases::refusal(conn, lease).await),
    }
}
