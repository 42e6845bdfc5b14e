//! The history of a job: each of its leases, and its end.

use super::steps::age;
use super::{ranges, usage};
use crate::db::{Tx, sql, state};
use crate::{LeaseKey, StoreError};
use prost::Message;
use yoto_proto::names::Collection;
use yoto_proto::v1::job_attempt::Outcome;
use yoto_proto::v1::{JobAttempt, JobError};

/// Most attempts of one job that are shown, the newest ones.
const SHOWN: u32 = 100;

/// Begins the attempt of a new lease.
pub(crate) async fn begin(tx: &mut Tx, lease: &LeaseKey) -> Result<(), StoreError> {
    sql("INSERT INTO job_attempts (job, lease, worker, begin_time) VALUES ($1, $2, $3, $4)")
        .bind(&lease.job_id)
        .bind(lease.column()?)
        .bind(&lease.worker_id)
        .bind(tx.now())
        .execute(tx, "recording the begin of an attempt")
        .await?;
    Ok(())
}

/// Ends the attempt of a lease, and frees the ranges of a render that it has not drawn. Leases of earlier
/// versions have no attempt.
pub(crate) async fn end(
    tx: &mut Tx,
    lease: &LeaseKey,
    outcome: Outcome,
    error: Option<&JobError>,
) -> Result<(), StoreError> {
    usage::attempt_ends(tx, lease).await?;
    sql(
        "UPDATE job_attempts SET end_time = CASE WHEN $3 < begin_time THEN begin_time ELSE $3 END, outcome = $4, error = $5, lease_deadline = NULL
         WHERE job = $1 AND lease = $2 AND end_time IS NULL",
    )
    .bind(&lease.job_id)
    .bind(lease.column()?)
    .bind(tx.now())
    .bind(outcome.as_str_name())
    .bind(error.map(Message::encode_to_vec))
    .execute(tx, "recording the end of an attempt")
    .await?;
    ranges::release(tx, lease).await
}

/// The outcome of the attempt of this lease, if it has ended.
pub(crate) async fn outcome(tx: &mut Tx, lease: &LeaseKey) -> Result<Option<Outcome>, StoreError> {
    let row = sql("SELECT outcome FROM job_attempts
         WHERE job = $1 AND lease = $2 AND worker = $3 AND end_time IS NOT NULL")
    .bind(&lease.job_id)
    .bind(lease.column()?)
    .bind(&lease.worker_id)
    .row(tx, "reading the end of an attempt")
    .await?;
    row.map(|row| parse(&row.text("outcome")?)).transpose()
}

/// The newest attempts of a job, oldest first. They are numbered from 1, because only workers may know the tokens.
pub(crate) async fn list(tx: &mut Tx, job_id: &str) -> Result<Vec<JobAttempt>, StoreError> {
    let rows = sql("SELECT * FROM (
             SELECT a.*, w.display_name, row_number() OVER (ORDER BY a.lease) AS ordinal
             FROM job_attempts a JOIN workers w ON w.id = a.worker
             WHERE a.job = $1 ORDER BY a.lease DESC LIMIT $2) AS newest
         ORDER BY lease")
    .bind(job_id)
    .bind(SHOWN)
    .rows(tx, "listing the attempts of a job")
    .await?;
    rows.iter()
        .map(|row| {
            Ok(JobAttempt {
                number: row.number("ordinal")?,
                worker: Collection::Workers.name(&row.text("worker")?),
                worker_display_name: row.text("display_name")?,
                begin_time: row.time("begin_time")?,
                end_time: row.time("end_time")?,
                outcome: parse(&row.text("outcome")?)? as i32,
                error: row.message("error")?,
            })
        })
        .collect()
}

/// Forgets attempts that ended more than `keep` seconds ago.
pub(crate) async fn forget(tx: &mut Tx, keep: f64, at: f64) -> Result<u64, StoreError> {
    let done = sql(concat!(
        "DELETE FROM job_attempts WHERE ",
        age!("end_time"),
        " > $2"
    ))
    .bind(at)
    .bind(keep)
    .execute(tx, "forgetting old attempts")
    .await?;
    Ok(done)
}

fn parse(name: &str) -> Result<Outcome, StoreError> {
    state("job_attempts.outcome", name, Outcome::from_str_name)
}
