//! Leases: the right to write to a job, with a deadline.
//!
//! The fencing token is the job's `lease` column. A write is guarded by the job's id, the token, the
//! worker and the state RUNNING; a worker that lost its lease matches no row. Workers that help with a render
//! have leases of their own ([`helpers`]), which guard the files that they commit.

use super::rows::{Columns, During, integer};
use super::{
    attempts, checkpoints, helpers, inputs, jobs, metrics, outcome, outputs, pins, queue, ranges,
};
use crate::checkpoints::retention::Retention;
use crate::store::{LeaseKey, LeaseOutcome, LeasedJob, StoreError};
use prost::Message;
use sqlx::query::Query;
use sqlx::sqlite::SqliteArguments;
use sqlx::{Sqlite, SqliteConnection};
use yoto_proto::names::Collection;
use yoto_proto::v1::{Checkpoint, JobError, JobSpec, Progress};

/// A statement on the job of a lease. Its first three parameters are those of [`bound`]; it matches no row once
/// the lease is stale. `$tail` follows the condition.
macro_rules! guarded {
    ($head:literal) => {
        guarded!($head, "")
    };
    ($head:literal, $tail:literal) => {
        concat!(
            $head,
            " WHERE id = ?1 AND lease = ?2 AND worker = ?3 AND state = 'RUNNING' ",
            $tail
        )
    };
}
pub(super) use guarded;

/// The same for any current lease of the job: of the worker that runs it, or of a helper.
macro_rules! held {
    ($head:literal) => {
        held!($head, "")
    };
    ($head:literal, $tail:literal) => {
        concat!(
            $head,
            " WHERE id = ?1 AND EXISTS (SELECT 1 FROM leases l
                 WHERE l.job = ?1 AND l.token = ?2 AND l.worker = ?3) ",
            $tail
        )
    };
}
pub(super) use held;

/// The guarded `statement` with the claim of `lease` bound to its first three parameters.
pub(super) fn bound<'q>(
    statement: &'static str,
    lease: &'q LeaseKey,
) -> Result<Query<'q, Sqlite, SqliteArguments>, StoreError> {
    Ok(sqlx::query(statement)
        .bind(&lease.job_id)
        .bind(lease.column()?)
        .bind(&lease.worker_id))
}

/// A worker's request for a job.
pub struct Ask<'a> {
    pub worker_id: &'a str,
    /// A repeated id finds its lease again; empty: none.
    pub request_id: &'a str,
    /// Whether it also helps with a render that another worker runs.
    pub help: bool,
    pub lease_seconds: f64,
    pub now: f64,
}

/// The lease of an earlier call with the same id, while it lasts; otherwise a lease of the first queued job
/// that the worker may run, or of a part of a running render with a higher priority. A job whose inputs can't be
/// found FAILS, so that it never blocks the others.
pub async fn lease(conn: &mut SqliteConnection, ask: &Ask<'_>) -> Result<LeaseOutcome, StoreError> {
    let mut failed = Vec::new();
    if let Some(leased) = again(conn, ask).await? {
        return Ok(LeaseOutcome {
            leased: Some(leased),
            failed,
        });
    }
    loop {
        let next = queue::next(conn, ask.worker_id, ask.now).await?;
        let priority = next.as_ref().map(|it| it.priority);
        if ask.help
            && let Some(id) = queue::to_help(conn, ask.worker_id, priority).await?
        {
            let key = helpers::begin(conn, ask, &id).await?;
            let leased = Some(leased(conn, &key).await?);
            return Ok(LeaseOutcome { leased, failed });
        }
        let Some(queue::Next { id, .. }) = next else {
            break;
        };
        let key = begin(conn, ask, &id).await?;
        match inputs_of(conn, &key).await {
            Ok(leased) => {
                return Ok(LeaseOutcome {
                    leased: Some(leased),
                    failed,
                });
            }
            Err(error) if error.is_failure() => return Err(error),
            Err(error) => {
                let message = format!("its inputs can't be found: {error}");
                let missing = JobError {
                    code: "INPUTS".to_owned(),
                    message: message.clone(),
                    violations: Vec::new(),
                };
                outcome::fail(conn, &key, missing, ask.now).await?;
                failed.push((Collection::Jobs.name(&id), message));
            }
        }
    }
    Ok(LeaseOutcome {
        leased: None,
        failed,
    })
}

/// Bits of the difference between successive tokens. The database's 63 bits have room for 8 million maximum
/// differences.
const GAP_BITS: u32 = 40;

/// A random difference between the last token of a job and the next one, so that a token can't be guessed from others.
pub fn gap() -> i64 {
    let random = uuid::Uuid::new_v4().as_u128() & ((1 << GAP_BITS) - 1);
    random as i64 + 1
}

/// Gives a queued job to the worker.
async fn begin(
    conn: &mut SqliteConnection,
    ask: &Ask<'_>,
    job_id: &str,
) -> Result<LeaseKey, StoreError> {
    start_lease_clock(conn, ask.now).await?;
    let row = sqlx::query(
        "UPDATE jobs SET state = 'RUNNING', lease = last_token + ?6, last_token = last_token + ?6,
             worker = ?2, lease_request = ?3, lease_deadline = ?4 + ?5, sequence = sequence + 1, waiting_error = NULL,
             not_before = NULL, start_time = coalesce(start_time, ?4)
         WHERE id = ?1 RETURNING lease",
    )
    .bind(job_id)
    .bind(ask.worker_id)
    .bind((!ask.request_id.is_empty()).then_some(ask.request_id))
    .bind(ask.now)
    .bind(ask.lease_seconds)
    .bind(gap())
    .fetch_one(&mut *conn)
    .await
    .during("leasing a job")?;
    let key = LeaseKey {
        job_id: job_id.to_owned(),
        worker_id: ask.worker_id.to_owned(),
        token: row.number("lease")?,
    };
    attempts::begin(conn, &key, ask.now).await?;
    Ok(key)
}

/// Chooses the checkpoint of a job that was just leased, and finds its inputs.
async fn inputs_of(conn: &mut SqliteConnection, key: &LeaseKey) -> Result<LeasedJob, StoreError> {
    // A render that has begun continues with the checkpoint that it began with.
    let begun = !outputs::list(conn, &key.job_id).await?.is_empty();
    if !begun && !ranges::any(conn, &key.job_id).await? {
        let spec = jobs::spec(conn, &key.job_id).await?;
        pins::renew(conn, &key.job_id, &spec).await?;
    }
    leased(conn, key).await
}

/// Restarts the lease clock if no lease runs: the gap before the first lease is not an outage.
async fn start_lease_clock(conn: &mut SqliteConnection, now: f64) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO lease_clock (id, last_tick)
         SELECT 1, ?1 WHERE NOT EXISTS (SELECT 1 FROM leases)
         ON CONFLICT (id) DO UPDATE SET last_tick = excluded.last_tick",
    )
    .bind(now)
    .execute(conn)
    .await
    .during("starting the lease clock")?;
    Ok(())
}

/// Whether the worker has a lease from an earlier call with the same id.
pub async fn is_repeat(
    conn: &mut SqliteConnection,
    worker_id: &str,
    request_id: &str,
) -> Result<bool, StoreError> {
    sqlx::query(
        "SELECT EXISTS (SELECT 1 FROM leases
             WHERE worker = ?1 AND lease_request = ?2) AS found",
    )
    .bind(worker_id)
    .bind(request_id)
    .fetch_one(conn)
    .await
    .during("looking for the lease of an earlier call")?
    .flag("found")
}

/// The lease of an earlier call with the same id, whose answer was lost. Its deadline is renewed, since the
/// worker counts from this call.
async fn again(
    conn: &mut SqliteConnection,
    ask: &Ask<'_>,
) -> Result<Option<LeasedJob>, StoreError> {
    if ask.request_id.is_empty() {
        return Ok(None);
    }
    let row = sqlx::query(
        "UPDATE jobs SET lease_deadline = ?3
         WHERE worker = ?1 AND state = 'RUNNING' AND lease_request = ?2 RETURNING id, lease",
    )
    .bind(ask.worker_id)
    .bind(ask.request_id)
    .bind(ask.now + ask.lease_seconds)
    .fetch_optional(&mut *conn)
    .await
    .during("looking for the lease of an earlier call")?;
    let key = match row {
        Some(row) => LeaseKey {
            job_id: row.text("id")?,
            worker_id: ask.worker_id.to_owned(),
            token: row.number("lease")?,
        },
        None => match helpers::again(conn, ask).await? {
            Some(key) => key,
            None => return Ok(None),
        },
    };
    leased(conn, &key).await.map(Some)
}

async fn leased(conn: &mut SqliteConnection, key: &LeaseKey) -> Result<LeasedJob, StoreError> {
    let job = jobs::get(conn, &key.job_id).await?;
    let spec = jobs::spec(conn, &key.job_id).await?;
    let inputs = inputs::resolve(conn, &key.job_id, &spec).await?;
    let runs = bound(guarded!("SELECT 1 FROM jobs"), key)?
        .fetch_optional(conn)
        .await
        .during("checking a lease")?;
    Ok(LeasedJob {
        job,
        token: key.token,
        inputs,
        helps: runs.is_none(),
    })
}

/// Whether the lease is current: of the worker that runs the job, or of a helper.
pub async fn is_held(conn: &mut SqliteConnection, lease: &LeaseKey) -> Result<bool, StoreError> {
    let row = bound(held!("SELECT 1 FROM jobs"), lease)?
        .fetch_optional(conn)
        .await
        .during("checking a lease")?;
    Ok(row.is_some())
}

/// The reason why a guarded write matched no row: the job does not exist, or the lease is stale.
pub async fn refusal(conn: &mut SqliteConnection, lease: &LeaseKey) -> StoreError {
    match jobs::get(conn, &lease.job_id).await {
        Ok(_) => lease.stale(),
        Err(error) => error,
    }
}

/// The order of a leased job.
pub async fn spec(conn: &mut SqliteConnection, lease: &LeaseKey) -> Result<JobSpec, StoreError> {
    let row = bound(held!("SELECT spec FROM jobs"), lease)?
        .fetch_optional(&mut *conn)
        .await
        .during("reading a leased job")?;
    match row {
        Some(row) => Ok(row.message("spec")?.unwrap_or_default()),
        None => Err(refusal(conn, lease).await),
    }
}

/// Extends the lease and records progress; the progress of a helper is not recorded.
pub async fn heartbeat(
    conn: &mut SqliteConnection,
    lease: &LeaseKey,
    progress: Option<Progress>,
    deadline: f64,
) -> Result<bool, StoreError> {
    let statement = guarded!(
        "UPDATE jobs SET lease_deadline = ?4,
             sequence = sequence + (?5 IS NOT NULL AND progress IS NOT ?5),
             progress = coalesce(?5, progress)",
        "RETURNING cancel_requested"
    );
    let row = bound(statement, lease)?
        .bind(deadline)
        .bind(progress.as_ref().map(Message::encode_to_vec))
        .fetch_optional(&mut *conn)
        .await
        .during("recording a heartbeat")?;
    match row {
        Some(row) => {
            if let Some(progress) = &progress {
                metrics::record(conn, &lease.job_id, progress).await?;
            }
            row.flag("cancel_requested")
        }
        None => helpers::heartbeat(conn, lease, deadline).await,
    }
}

/// Records a checkpoint of the leased train job's model, and removes those that the model no longer keeps. The
/// count of lost workers starts again at 0.
pub async fn publish(
    conn: &mut SqliteConnection,
    lease: &LeaseKey,
    checkpoint: Checkpoint,
    default: Retention,
    now: f64,
) -> Result<(), StoreError> {
    integer("checkpoint.step", checkpoint.step)?;
    let statement = guarded!(
        "UPDATE jobs SET losses = 0",
        "AND kind = 'train' RETURNING model"
    );
    let row = bound(statement, lease)?
        .fetch_optional(&mut *conn)
        .await
        .during("checking a lease")?;
    match row {
        Some(row) => {
            let model = row.text("model")?;
            checkpoints::record(conn, &model, &lease.job_id, checkpoint, now).await?;
            checkpoints::thin_out(conn, &model, default, now).await
        }
        None => Err(refusal(conn, lease).await),
    }
}
