//! The order of the queue: the highest priority, then the owner with the fewest running jobs, then the oldest
//! job. A model has one trainer at a time, paused kinds wait, a cordoned worker gets nothing, nor does anyone
//! during a drain, and a worker gets no order that it does not understand, nor a film without a pose model. A
//! worker runs the jobs of its tenant. Without a job in the queue, it helps with a render.

use super::operators::admitted;
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

/// Jobs `q` of the tenant of worker `$1` that it may lease at time `$2`. The kinds depend on the worker alone, so that a database
/// finds them once and not for each job.
macro_rules! waiting {
    () => {
        concat!(
            admitted!(),
            " AND q.state = 'QUEUED' AND q.tenant = (SELECT tenant FROM workers WHERE id = $1)
           AND (q.not_before IS NULL OR q.not_before <= $2)
           AND q.kind IN (SELECT kind FROM worker_kinds WHERE worker = $1
                          EXCEPT SELECT kind FROM paused_kinds
                          WHERE tenant = (SELECT tenant FROM workers WHERE id = $1))
           AND q.order_level <= (SELECT order_level FROM workers WHERE id = $1)
           AND q.film <= (SELECT reads_films FROM workers WHERE id = $1)
           AND NOT (q.kind = 'train' AND EXISTS (
               SELECT 1 FROM jobs r
               WHERE r.model = q.model AND r.kind = 'train' AND r.state = 'RUNNING'))"
        )
    };
}

/// Whether a job for the worker is queued. Workers ask often and mostly without success; this
/// read saves a transaction on the writer's connection, and a disk access, each time.
pub(crate) async fn any(tx: &mut Tx, worker_id: &str) -> Result<bool, StoreError> {
    let row = sql(concat!(
        "SELECT EXISTS (SELECT 1 FROM jobs q WHERE ",
        waiting!(),
        ") AS waiting"
    ))
    .bind(worker_id)
    .bind(tx.now())
    .one(tx, "looking for a queued job")
    .await?;
    row.flag("waiting")
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

/// A running render with undrawn pictures and a priority higher than `above`, that of the next queued job. The
/// highest priority comes first, then the render with the fewest workers, then the oldest one. A worker that
/// has failed at a render, or was lost, does not help with it again.
pub(crate) async fn to_help(
    tx: &mut Tx,
    worker_id: &str,
    above: Option<i64>,
) -> Result<Option<String>, StoreError> {
    let row = sql(concat!(
        "SELECT j.id FROM jobs j WHERE ",
        admitted!(),
        " AND j.state = 'RUNNING' AND j.tenant = (SELECT tenant FROM workers WHERE id = $1)
             AND j.kind = 'render' AND j.cancel_requested = 0
             AND j.kind IN (SELECT kind FROM worker_kinds WHERE worker = $1
                            EXCEPT SELECT kind FROM paused_kinds
                            WHERE tenant = (SELECT tenant FROM workers WHERE id = $1))
             AND j.order_level <= (SELECT order_level FROM workers WHERE id = $1)
             AND j.priority > coalesce($2, -1) AND j.lost_workers < $3
             AND EXISTS (SELECT 1 FROM render_ranges r
                         WHERE r.job = j.id AND r.token IS NULL AND r.drawn = 0)
             AND NOT EXISTS (SELECT 1 FROM job_attempts a
                             WHERE a.job = j.id AND a.worker = $1 AND a.outcome <> 'HELPED')
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
