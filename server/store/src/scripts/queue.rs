//! The order of the queue: the highest priority, then the owner with the fewest running jobs, then the oldest
//! job. A model has one trainer at a time, paused kinds wait, a cordoned worker gets nothing, nor does anyone
//! during a drain, and a worker gets no order that it does not understand, nor a film without a pose model. A
//! worker runs the jobs of its tenant. Without a job in the queue, it helps with a render.

use super::leases::Ask;
use super::operators::admitted;
use super::workers::{self, NOTE_EVERY};
use crate::StoreError;
use crate::db::{Tx, claimed, sql};

/// Number of workers lost over a render after which no more helpers are assigned: its pictures may be what
/// crashes them, and only losses of the worker that runs the job count towards its failure.
const LOSSES: u32 = 4;

/// The first job of the queue.
#[derive(Debug)]
pub(crate) struct Next {
    /// Its id.
    pub id: String,
    /// Its priority, 0 to 3.
    pub priority: i64,
    /// The model that it trains, if it is a training.
    pub trains: Option<String>,
}

/// Jobs `q` of the tenant of worker `$1` that it may lease at time `$2`, if it runs their kind.
macro_rules! of_its_kind {
    () => {
        "q.state = 'QUEUED' AND q.tenant = (SELECT tenant FROM workers WHERE id = $1)
           AND (q.not_before IS NULL OR q.not_before <= $2)
           AND q.order_level <= (SELECT order_level FROM workers WHERE id = $1)
           AND q.film <= (SELECT reads_films FROM workers WHERE id = $1)
           AND NOT (q.kind = 'train' AND EXISTS (
               SELECT 1 FROM jobs r
               WHERE r.model = q.model AND r.kind = 'train' AND r.state = 'RUNNING'))"
    };
}

/// Jobs `q` that worker `$1` may lease at time `$2`. The kinds depend on the worker alone, so that a database finds them once and
/// not for each job.
macro_rules! waiting {
    () => {
        concat!(
            admitted!(),
            " AND q.kind IN (SELECT kind FROM worker_kinds WHERE worker = $1
                          EXCEPT SELECT kind FROM paused_kinds
                          WHERE tenant = (SELECT tenant FROM workers WHERE id = $1))
           AND ",
            of_its_kind!()
        )
    };
}

/// Whether there are any, by a look at the first of each kind: a queue of other or paused kinds is not read. OFFSET keeps PostgreSQL
/// from a join, which reads it.
macro_rules! any_waiting {
    () => {
        concat!(
            admitted!(),
            " AND EXISTS (
               SELECT 1 FROM worker_kinds k WHERE k.worker = $1
               AND NOT EXISTS (SELECT 1 FROM paused_kinds p WHERE p.kind = k.kind
                               AND p.tenant = (SELECT tenant FROM workers WHERE id = $1))
               AND EXISTS (SELECT 1 FROM jobs q WHERE q.kind = k.kind AND ",
            of_its_kind!(),
            " LIMIT 1 OFFSET 0))"
        )
    };
}

/// Running renders `j` with undrawn pictures that worker `$1` may help with, after fewer than `$3` lost workers. A worker that
/// has failed at a render, or was lost, does not help with it again.
macro_rules! helpable {
    () => {
        concat!(
            admitted!(),
            " AND j.state = 'RUNNING' AND j.tenant = (SELECT tenant FROM workers WHERE id = $1)
             AND j.kind = 'render' AND j.cancel_requested = 0
             AND j.kind IN (SELECT kind FROM worker_kinds WHERE worker = $1
                            EXCEPT SELECT kind FROM paused_kinds
                            WHERE tenant = (SELECT tenant FROM workers WHERE id = $1))
             AND j.order_level <= (SELECT order_level FROM workers WHERE id = $1)
             AND j.lost_workers < $3
             AND EXISTS (SELECT 1 FROM render_ranges r
                         WHERE r.job = j.id AND r.token IS NULL AND r.drawn = 0)
             AND NOT EXISTS (SELECT 1 FROM job_attempts a
                             WHERE a.job = j.id AND a.worker = $1 AND a.outcome <> 'HELPED')"
        )
    };
}

/// What a worker's request may find.
#[derive(Debug)]
pub(crate) struct Prospect {
    /// Whether a request of the worker is noted that is younger than [`NOTE_EVERY`].
    pub noted: bool,
    /// Whether there is something to lease.
    pub work: bool,
}

/// What the request of `ask` may find, by one statement. Workers ask often and mostly without success; this read saves a
/// transaction, and a disk access, each time.
pub(crate) async fn prospect(tx: &mut Tx, ask: &Ask<'_>) -> Result<Prospect, StoreError> {
    let row = sql(concat!(
        "SELECT coalesce(w.asked_time BETWEEN $7 AND $2, FALSE) AS noted,
             EXISTS (SELECT 1 FROM leases l WHERE l.worker = $1 AND l.lease_request = $5)
                 OR ",
        any_waiting!(),
        " OR $6 = 1 AND EXISTS (SELECT 1 FROM jobs j WHERE ",
        helpable!(),
        ") AS work
         FROM workers w WHERE w.id = $1 AND w.tenant = $4"
    ))
    .bind(ask.worker_id)
    .bind(tx.now())
    .bind(LOSSES)
    .bind(ask.tenant.id())
    .bind(ask.request_id)
    .bind(ask.help)
    .bind(tx.now() - NOTE_EVERY)
    .row(tx, "looking for a queued job")
    .await?;
    let row = row.ok_or_else(|| workers::not_found(ask.worker_id))?;
    Ok(Prospect {
        noted: row.flag("noted")?,
        work: row.flag("work")?,
    })
}

/// The first job in the queue that the worker may run, claimed.
pub(crate) async fn next(tx: &mut Tx, worker_id: &str) -> Result<Option<Next>, StoreError> {
    let choice = sql(concat!(
        "WITH running AS (
             SELECT owner, count(*) AS jobs FROM jobs
             WHERE state = 'RUNNING' AND tenant = (SELECT tenant FROM workers WHERE id = $1) GROUP BY owner)
         SELECT j.id, j.priority, CASE WHEN j.kind = 'train' THEN j.model END AS trains
         FROM jobs j WHERE j.ord = (
             SELECT q.ord FROM jobs q LEFT JOIN running r ON r.owner = q.owner WHERE ",
        waiting!(),
        " ORDER BY q.priority DESC, coalesce(r.jobs, 0), q.ord LIMIT 1 ",
        claimed!(),
        ")"
    ))
    .bind(worker_id)
    .bind(tx.now());
    let row = tx.claim(choice, "choosing the next job").await?;
    row.map(|row| {
        Ok(Next {
            id: row.text("id")?,
            priority: row.number("priority")?,
            trains: row.maybe_text("trains")?,
        })
    })
    .transpose()
}

/// A running render to help with, of a priority higher than `above`, that of the next queued job. The
/// highest priority comes first, then the render with the fewest workers, then the oldest one.
pub(crate) async fn to_help(
    tx: &mut Tx,
    worker_id: &str,
    above: Option<i64>,
) -> Result<Option<String>, StoreError> {
    let row = sql(concat!(
        "SELECT j.id FROM jobs j WHERE ",
        helpable!(),
        " AND j.priority > coalesce($2, -1)
         ORDER BY j.priority DESC,
             (SELECT count(*) FROM render_ranges r WHERE r.job = j.id AND r.token IS NOT NULL),
             j.ord LIMIT 1"
    ))
    .bind(worker_id)
    .bind(above)
    .bind(LOSSES)
    .row(tx, "looking for a render to help with")
    .await?;
    row.map(|row| row.text("id")).transpose()
}
