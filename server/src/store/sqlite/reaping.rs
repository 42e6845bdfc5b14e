//! Jobs of silent workers.

use super::rows::{Columns, During, state};
use super::ticks::Ticks;
use super::{helpers, outcome};
use crate::rules::losses::{Verdict, verdict};
use crate::rules::outage;
use crate::store::{LeaseKey, Reaped, StoreError};
use sqlx::sqlite::SqliteRow;
use sqlx::{Row, SqliteConnection};
use yoto_proto::names::Collection;
use yoto_proto::v1::job;
use yoto_proto::v1::job_attempt::Outcome;

/// Interval of recorded ticks as a share of a lease: the length of an outage is known to within this.
const TICKS_PER_LEASE: f64 = 8.0;

/// Whether a tick has anything to do at `now`: a lease expired, or the clock is to be recorded.
pub async fn is_due(
    conn: &mut SqliteConnection,
    lease_seconds: f64,
    now: f64,
) -> Result<bool, StoreError> {
    sqlx::query(
        "SELECT EXISTS (SELECT 1 FROM leases WHERE (
             lease_deadline < ?1
             OR NOT EXISTS (
                 SELECT 1 FROM lease_clock WHERE last_tick BETWEEN ?1 - ?2 AND ?1)))",
    )
    .bind(now)
    .bind(lease_seconds / TICKS_PER_LEASE)
    .fetch_one(conn)
    .await
    .and_then(|row| row.try_get(0))
    .during("looking for expired leases")
}

/// Extends the deadlines by an outage since the last tick, takes back every job whose lease has expired
/// nevertheless, and records the tick.
pub async fn tick(
    conn: &mut SqliteConnection,
    cap: u32,
    lease_seconds: f64,
    now: f64,
) -> Result<Vec<Reaped>, StoreError> {
    forgive(conn, lease_seconds, now).await?;
    let rows = sqlx::query(
        "SELECT * FROM jobs WHERE state = 'RUNNING' AND lease_deadline < ?1 ORDER BY ord",
    )
    .bind(now)
    .fetch_all(&mut *conn)
    .await
    .during("reading jobs with expired leases")?;
    let mut reaped = take_back(conn, &rows, cap, now).await?;
    let helpers =
        sqlx::query("SELECT job, lease, worker FROM job_attempts WHERE lease_deadline < ?1")
            .bind(now)
            .fetch_all(&mut *conn)
            .await
            .during("reading expired leases of helpers")?;
    reaped.extend(do_without(conn, &helpers, now).await?);
    Ticks::Leases.record(conn, now).await?;
    Ok(reaped)
}

/// Moves deadlines by the time in which the service checked no leases.
async fn forgive(
    conn: &mut SqliteConnection,
    lease_seconds: f64,
    now: f64,
) -> Result<(), StoreError> {
    let last_tick = Ticks::Leases.last(conn).await?;
    let Some(shift) = last_tick.and_then(|last| outage::shift(last, now, lease_seconds)) else {
        return Ok(());
    };
    let rows = sqlx::query("SELECT job, token, lease_deadline FROM leases")
        .fetch_all(&mut *conn)
        .await
        .during("reading the deadlines of leases")?;
    tracing::warn!(
        seconds = shift.gap,
        leases = rows.len(),
        "an outage of the service, or a step of its clock: leases are extended by it"
    );
    for row in &rows {
        let deadline = row.real("lease_deadline")?.unwrap_or(now);
        for lease in [
            "UPDATE jobs SET lease_deadline = ?3
             WHERE id = ?1 AND lease = ?2 AND state = 'RUNNING'",
            "UPDATE job_attempts SET lease_deadline = ?3
             WHERE job = ?1 AND lease = ?2 AND lease_deadline IS NOT NULL",
        ] {
            sqlx::query(lease)
                .bind(row.text("job")?)
                .bind(row.number::<i64>("token")?)
                .bind(shift.apply(deadline, now))
                .execute(&mut *conn)
                .await
                .during("extending a lease by an outage")?;
        }
    }
    Ok(())
}

/// Takes back the jobs of workers that ran in an earlier process of the coordinator.
pub async fn take_back_embedded(
    conn: &mut SqliteConnection,
    cap: u32,
    now: f64,
) -> Result<Vec<Reaped>, StoreError> {
    let rows = sqlx::query(
        "SELECT j.* FROM jobs j JOIN workers w ON w.id = j.worker
         WHERE j.state = 'RUNNING' AND w.embedded = 1 ORDER BY j.ord",
    )
    .fetch_all(&mut *conn)
    .await
    .during("reading jobs of an earlier process")?;
    let mut reaped = take_back(conn, &rows, cap, now).await?;
    let helpers = sqlx::query(
        "SELECT a.job, a.lease, a.worker FROM job_attempts a JOIN workers w ON w.id = a.worker
         WHERE a.lease_deadline IS NOT NULL AND w.embedded = 1",
    )
    .fetch_all(&mut *conn)
    .await
    .during("reading helpers of an earlier process")?;
    reaped.extend(do_without(conn, &helpers, now).await?);
    Ok(reaped)
}

/// Ends the leases of lost helpers. Their renders continue, and the loss does not count against them.
async fn do_without(
    conn: &mut SqliteConnection,
    rows: &[SqliteRow],
    now: f64,
) -> Result<Vec<Reaped>, StoreError> {
    let mut reaped = Vec::with_capacity(rows.len());
    for row in rows {
        let lease = LeaseKey {
            job_id: row.text("job")?,
            worker_id: row.text("worker")?,
            token: row.number("lease")?,
        };
        // The job may have ended in this tick, and the lease with it.
        if !helpers::lose(conn, &lease, now).await? {
            continue;
        }
        let row = sqlx::query("SELECT losses, state FROM jobs WHERE id = ?1")
            .bind(&lease.job_id)
            .fetch_one(&mut *conn)
            .await
            .during("counting a lost worker")?;
        reaped.push(Reaped {
            job: Collection::Jobs.name(&lease.job_id),
            worker: Collection::Workers.name(&lease.worker_id),
            losses: row.number("losses")?,
            state: state("jobs.state", &row.text("state")?, job::State::from_str_name)?,
        });
    }
    Ok(reaped)
}

async fn take_back(
    conn: &mut SqliteConnection,
    rows: &[SqliteRow],
    cap: u32,
    now: f64,
) -> Result<Vec<Reaped>, StoreError> {
    let mut reaped = Vec::with_capacity(rows.len());
    for row in rows {
        let lease = LeaseKey {
            job_id: row.text("id")?,
            worker_id: row.maybe_text("worker")?.unwrap_or_default(),
            token: row.number("lease")?,
        };
        let worker = Collection::Workers.name(&lease.worker_id);
        let losses = row.number::<u32>("losses")?.saturating_add(1);
        count_lost_worker(conn, &lease.job_id).await?;
        let state = match verdict(losses, cap, row.flag("cancel_requested")?, &worker) {
            Verdict::Cancel => {
                outcome::cancel(conn, &lease, now).await?;
                job::State::Cancelled
            }
            Verdict::Fail(error) => {
                outcome::fail_after(conn, &lease, error, Outcome::Lost, now).await?;
                job::State::Failed
            }
            Verdict::Requeue => {
                outcome::requeue(conn, &lease, Outcome::Lost, now).await?;
                job::State::Queued
            }
        };
        reaped.push(Reaped {
            job: Collection::Jobs.name(&lease.job_id),
            worker,
            losses,
            state,
        });
    }
    Ok(reaped)
}

/// The change of state that follows in the same transaction increases the sequence number.
async fn count_lost_worker(conn: &mut SqliteConnection, job_id: &str) -> Result<(), StoreError> {
    sqlx::query(
        "UPDATE jobs SET lost_workers = lost_workers + 1, losses = losses + 1 WHERE id = ?1",
    )
    .bind(job_id)
    .execute(conn)
    .await
    .during("counting a lost worker")?;
    Ok(())
}
