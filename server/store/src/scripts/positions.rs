//! Positions in the queue: how many jobs of the tenant come before another.

use crate::db::{Tx, sql};
use crate::{StoreError, Tenant};
use yoto_proto::v1::{Job, job};

/// A job that was read, and where it stands.
#[derive(Debug)]
pub(super) struct JobToPlace<'a> {
    /// Its priority, as in its row.
    pub priority: i64,
    /// Its place among all jobs.
    pub ord: i64,
    /// The job.
    pub job: &'a mut Job,
}

/// Sets the positions of those of `jobs` that are QUEUED. The database walks over the queue once, from each to the next,
/// however many jobs ask: a page of 100 that counted all jobs ahead of each took 137 ms with 20,000 in the queue.
pub(super) async fn fill(
    tx: &mut Tx,
    tenant: &Tenant,
    jobs: Vec<JobToPlace<'_>>,
) -> Result<(), StoreError> {
    let queued = jobs
        .into_iter()
        .filter(|asked| asked.job.state() == job::State::Queued);
    let mut queued: Vec<JobToPlace<'_>> = queued.collect();
    if queued.is_empty() {
        return Ok(());
    }
    // The order of the queue, but for turns of owners.
    queued.sort_by_key(|asked| (-asked.priority, asked.ord));
    let mut query = sql("WITH asked (priority, since, ord) AS (VALUES ").bind(tenant.id());
    let mut before: Option<(i64, i64)> = None;
    for (i, JobToPlace { priority, ord, .. }) in queued.iter().enumerate() {
        query.push(if i == 0 { "(" } else { ", (" });
        let since = before.filter(|before| before.0 == *priority);
        query.push_all([*priority, since.map_or(0, |before| before.1), *ord]);
        query.push(")");
        before = Some((*priority, *ord));
    }
    query.push(
        ") SELECT
             (SELECT count(*) FROM jobs q WHERE q.state = 'QUEUED' AND q.tenant = $1
                  AND q.priority = a.priority AND q.ord >= a.since AND q.ord < a.ord) AS since,
             CASE WHEN a.since = 0 THEN
                 (SELECT count(*) FROM jobs q WHERE q.state = 'QUEUED' AND q.tenant = $1
                      AND q.priority > a.priority)
             END AS above
         FROM asked a ORDER BY a.priority DESC, a.ord",
    );
    let rows = query.rows(tx, "counting the jobs ahead of others").await?;
    let mut ahead: u32 = 0;
    for (row, asked) in rows.iter().zip(queued) {
        ahead = row.maybe_number("above")?.unwrap_or(ahead) + row.number::<u32>("since")?;
        asked.job.queue_position = ahead;
    }
    Ok(())
}
