//! Whose turn it is: the highest priority, then the owner with the fewest running jobs, then the
//! oldest job. A model has one trainer at a time, and paused kinds wait.

use super::rows::{Columns, During};
use crate::store::StoreError;
use sqlx::SqliteConnection;
use yoto_proto::names::Collection;

/// Jobs `q` that worker `?1` may have at time `?2`.
macro_rules! waiting {
    () => {
        "q.state = 'QUEUED' AND (q.not_before IS NULL OR q.not_before <= ?2)
           AND q.kind IN (SELECT kind FROM worker_kinds WHERE worker = ?1
                          EXCEPT SELECT kind FROM paused_kinds)
           AND NOT (q.kind = 'train' AND EXISTS (
               SELECT 1 FROM jobs r
               WHERE r.model = q.model AND r.kind = 'train' AND r.state = 'RUNNING'))"
    };
}

/// Whether a job for the worker is queued. Workers ask often and mostly without success; this
/// read saves a transaction on the writer's connection, and a disk access, each time.
pub async fn any(
    conn: &mut SqliteConnection,
    worker_id: &str,
    now: f64,
) -> Result<bool, StoreError> {
    let row = sqlx::query(concat!(
        "SELECT EXISTS (SELECT 1 FROM jobs q WHERE ",
        waiting!(),
        ") AS waiting FROM workers w WHERE w.id = ?1"
    ))
    .bind(worker_id)
    .bind(now)
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

/// The job whose turn it is at the worker.
pub async fn next(
    conn: &mut SqliteConnection,
    worker_id: &str,
    now: f64,
) -> Result<Option<String>, StoreError> {
    let row = sqlx::query(concat!(
        "WITH running AS (
             SELECT owner, count(*) AS jobs FROM jobs WHERE state = 'RUNNING' GROUP BY owner)
         SELECT j.id FROM jobs j WHERE j.ord = (
             SELECT q.ord FROM jobs q LEFT JOIN running r ON r.owner = q.owner WHERE ",
        waiting!(),
        " ORDER BY q.priority DESC, coalesce(r.jobs, 0), q.ord LIMIT 1)"
    ))
    .bind(worker_id)
    .bind(now)
    .fetch_optional(conn)
    .await
    .during("choosing the next job")?;
    row.map(|row| row.text("id")).transpose()
}
