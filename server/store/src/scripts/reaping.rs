//! Jobs of silent workers.

use super::ticks::Ticks;
use super::{helpers, outcome};
use crate::db::{Lock, Row, Tx, sql, state};
use crate::rules::losses::{Verdict, verdict};
use crate::rules::outage;
use crate::{LeaseKey, Reaped, StoreError};
use yoto_proto::names::Collection;
use yoto_proto::v1::job;
use yoto_proto::v1::job_attempt::Outcome;

/// Interval of recorded ticks as a share of a lease: the length of an outage is known to within this.
const TICKS_PER_LEASE: f64 = 8.0;

/// Whether a tick has anything to do: a lease expired, or the clock is to be recorded.
pub(crate) async fn is_due(tx: &mut Tx, lease_seconds: f64) -> Result<bool, StoreError> {
    sql("SELECT EXISTS (SELECT 1 FROM leases WHERE (
             lease_deadline < $1
             OR NOT EXISTS (
                 SELECT 1 FROM lease_clock WHERE last_tick BETWEEN $1 - $2 AND $1))) AS due")
    .bind(tx.now())
    .bind(lease_seconds / TICKS_PER_LEASE)
    .one(tx, "looking for expired leases")
    .await?
    .flag("due")
}

/// A lease whose worker is lost.
#[derive(Debug)]
pub(crate) struct Lost {
    lease: LeaseKey,
    /// Its deadline when it was found. A lease that was extended since then is kept.
    deadline: f64,
    helps: bool,
}

/// Extends the deadlines by an outage since the last tick, records the tick, and returns the leases that have expired
/// nevertheless.
pub(crate) async fn tick(tx: &mut Tx, lease_seconds: f64) -> Result<Vec<Lost>, StoreError> {
    forgive(tx, lease_seconds).await?;
    Ticks::Leases.record(tx).await?;
    let rows = sql(
        "SELECT l.job, l.token, l.worker, l.lease_deadline, l.token <> j.lease AS helps
         FROM leases l JOIN jobs j ON j.id = l.job WHERE l.lease_deadline < $1 ORDER BY helps, j.ord",
    )
    .bind(tx.now())
    .rows(tx, "looking for expired leases")
    .await?;
    rows.iter().map(lost).collect()
}

/// The leases of workers that ran in an earlier process of the coordinator `instance`. Those of a version that had no
/// instances ran in the only coordinator.
pub(crate) async fn embedded(tx: &mut Tx, instance: &str) -> Result<Vec<Lost>, StoreError> {
    let rows = sql(
        "SELECT l.job, l.token, l.worker, l.lease_deadline, l.token <> j.lease AS helps
         FROM leases l JOIN jobs j ON j.id = l.job JOIN workers w ON w.id = l.worker
         WHERE w.embedded = 1 AND (w.instance = $1 OR w.instance IS NULL) ORDER BY helps, j.ord",
    )
    .bind(instance)
    .rows(tx, "looking for leases of an earlier process")
    .await?;
    rows.iter().map(lost).collect()
}

fn lost(row: &Row) -> Result<Lost, StoreError> {
    Ok(Lost {
        lease: LeaseKey {
            job_id: row.text("job")?,
            worker_id: row.maybe_text("worker")?.unwrap_or_default(),
            token: row.number("token")?,
        },
        deadline: row.real("lease_deadline")?.unwrap_or_default(),
        helps: row.flag("helps")?,
    })
}

/// Moves deadlines by the time in which the service checked no leases.
async fn forgive(tx: &mut Tx, lease_seconds: f64) -> Result<(), StoreError> {
    let now = tx.now();
    Ticks::Leases.lock(tx).await?;
    let last_tick = Ticks::Leases.last(tx).await?;
    let Some(shift) = last_tick.and_then(|last| outage::shift(last, now, lease_seconds)) else {
        return Ok(());
    };
    let rows = sql("SELECT job, token, lease_deadline FROM leases")
        .rows(tx, "reading the deadlines of leases")
        .await?;
    tracing::warn!(
        seconds = shift.gap,
        leases = rows.len(),
        "an outage of the service, or a step of its clock: leases are extended by it"
    );
    for row in &rows {
        let deadline = row.real("lease_deadline")?.unwrap_or(now);
        for lease in [
            "UPDATE jobs SET lease_deadline = $3
             WHERE id = $1 AND lease = $2 AND state = 'RUNNING' AND lease_deadline = $4",
            "UPDATE job_attempts SET lease_deadline = $3
             WHERE job = $1 AND lease = $2 AND lease_deadline = $4",
        ] {
            sql(lease)
                .bind(row.text("job")?)
                .bind(row.number::<i64>("token")?)
                .bind(shift.apply(deadline, now))
                .bind(deadline)
                .execute(tx, "extending a lease by an outage")
                .await?;
        }
    }
    Ok(())
}

/// Ends a lost lease; `None` if it was extended or has ended since it was found. The render of a lost helper continues, and
/// the loss does not count against it. The job of a lost worker returns to the queue, or ends.
pub(crate) async fn take_back(
    tx: &mut Tx,
    lost: &Lost,
    cap: u32,
) -> Result<Option<Reaped>, StoreError> {
    let lease = &lost.lease;
    tx.lock(Lock::Job(&lease.job_id)).await?;
    let found = sql(
        "SELECT j.losses, j.cancel_requested, j.state FROM jobs j JOIN leases l ON l.job = j.id
         WHERE j.id = $1 AND l.token = $2 AND l.lease_deadline = $3",
    )
    .bind(&lease.job_id)
    .bind(lease.column()?)
    .bind(lost.deadline)
    .row(tx, "reading a job of a lost worker")
    .await?;
    let Some(row) = found else {
        return Ok(None);
    };
    let worker = Collection::Workers.name(&lease.worker_id);
    let losses = row.number::<u32>("losses")?;
    let (losses, state) = if lost.helps {
        helpers::lose(tx, lease).await?;
        let state = state("jobs.state", &row.text("state")?, job::State::from_str_name)?;
        (losses, state)
    } else {
        let losses = losses.saturating_add(1);
        count_lost_worker(tx, &lease.job_id).await?;
        let state = match verdict(losses, cap, row.flag("cancel_requested")?, &worker) {
            Verdict::Cancel => {
                outcome::cancel(tx, lease).await?;
                job::State::Cancelled
            }
            Verdict::Fail(error) => {
                outcome::fail_after(tx, lease, error, Outcome::Lost).await?;
                job::State::Failed
            }
            Verdict::Requeue => {
                outcome::requeue(tx, lease, Outcome::Lost).await?;
                job::State::Queued
            }
        };
        (losses, state)
    };
    Ok(Some(Reaped {
        job: Collection::Jobs.name(&lease.job_id),
        worker,
        losses,
        state,
    }))
}

/// The change of state that follows in the same transaction increases the sequence number.
async fn count_lost_worker(tx: &mut Tx, job_id: &str) -> Result<(), StoreError> {
    sql("UPDATE jobs SET lost_workers = lost_workers + 1, losses = losses + 1 WHERE id = $1")
        .bind(job_id)
        .execute(tx, "counting a lost worker")
        .await?;
    Ok(())
}
