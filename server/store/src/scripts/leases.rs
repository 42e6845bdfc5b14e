//! Leases: the right to write to a job, with a deadline.
//!
//! The fencing token is the job's `lease` column. A write is guarded by the job's id, the token, the
//! worker and the state RUNNING; a worker that lost its lease matches no row. Workers that help with a render
//! have leases of their own ([`helpers`]), which guard the files that they commit.

use super::metrics::known_points;
use super::{
    attempts, checkpoints, consent_rule, helpers, inputs, jobs, metrics, outcome, outputs, pins,
    queue, ranges, workers,
};
use crate::db::{Lock, Row, Statement, Tx, integer, sql};
use crate::rules::retention::Retention;
use crate::{LeaseKey, LeasedJob, StoreError, Tenant};
use prost::Message;
use yoto_proto::names::Collection;
use yoto_proto::v1::{Checkpoint, ErrorReason, JobError, JobSpec, Progress};

/// A statement on the job of a lease. Its first three parameters are those of [`bound`]; it matches no row once
/// the lease is stale. `$tail` follows the condition.
macro_rules! guarded {
    ($head:literal) => {
        guarded!($head, "")
    };
    ($head:literal, $tail:literal) => {
        concat!(
            $head,
            " WHERE id = $1 AND lease = $2 AND worker = $3 AND state = 'RUNNING' ",
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
            " WHERE id = $1 AND EXISTS (SELECT 1 FROM leases l
                 WHERE l.job = $1 AND l.token = $2 AND l.worker = $3) ",
            $tail
        )
    };
}
pub(super) use held;

/// The guarded `statement` with the claim of `lease` bound to its first three parameters.
pub(super) fn bound(statement: &'static str, lease: &LeaseKey) -> Result<Statement, StoreError> {
    Ok(sql(statement)
        .bind(&lease.job_id)
        .bind(lease.column()?)
        .bind(&lease.worker_id))
}

/// A worker's request for a job.
pub(crate) struct Ask<'a> {
    /// The worker's tenant.
    pub tenant: &'a Tenant,
    pub worker_id: &'a str,
    /// A repeated id finds its lease again; empty: none.
    pub request_id: &'a str,
    /// Whether it also helps with a render that another worker runs.
    pub help: bool,
    pub lease_seconds: f64,
    /// Whether nobody is in a job without a valid consent.
    pub requires_consent: bool,
}

/// The answer to a request for a job.
#[derive(Debug)]
pub(crate) enum LeaseAnswer {
    /// A lease.
    Leased(Box<LeasedJob>),
    /// Another job has to be chosen: this one, `jobs/{id}`, FAILED for this reason, so that it never blocks the others.
    Failed(String, String),
    /// Another job has to be chosen: another transaction has taken this one.
    Taken,
    /// No job waits.
    Nothing,
}

/// The lease of an earlier call with the same id, while it lasts; otherwise a lease of the first queued job
/// that the worker may run, or of a part of a running render with a higher priority. A job whose inputs can't be
/// found, or with a person who lacks consent, FAILS.
pub(crate) async fn lease(tx: &mut Tx, ask: &Ask<'_>) -> Result<LeaseAnswer, StoreError> {
    if let Some(leased) = again(tx, ask).await? {
        return Ok(LeaseAnswer::Leased(leased.into()));
    }
    let next = queue::next(tx, ask.worker_id).await?;
    let priority = next.as_ref().map(|it| it.priority);
    if ask.help
        && let Some(id) = queue::to_help(tx, ask.worker_id, priority).await?
    {
        return match helpers::begin(tx, ask, &id).await? {
            Some(key) => Ok(LeaseAnswer::Leased(
                leased(tx, ask.tenant, &key).await?.into(),
            )),
            None => Ok(LeaseAnswer::Taken),
        };
    }
    let Some(queue::Next { id, trains, .. }) = next else {
        return Ok(LeaseAnswer::Nothing);
    };
    if let Some(model) = trains {
        // Otherwise, two trainings of one model could each find that no other one runs.
        tx.lock(Lock::Model(&model)).await?;
    }
    let Some(key) = begin(tx, ask, &id).await? else {
        return Ok(LeaseAnswer::Taken);
    };
    match inputs_of(tx, ask, &key).await {
        Ok(leased) => Ok(LeaseAnswer::Leased(leased.into())),
        Err(error) if error.is_failure() => Err(error),
        Err(error) => {
            let error = match error {
                StoreError::Rule {
                    reason: ErrorReason::Consent,
                    message,
                } => consent_rule::job_error(message),
                error => JobError {
                    code: "INPUTS".to_owned(),
                    message: format!("its inputs can't be found: {error}"),
                    violations: Vec::new(),
                },
            };
            let message = error.message.clone();
            outcome::fail(tx, &key, error).await?;
            Ok(LeaseAnswer::Failed(Collection::Jobs.name(&id), message))
        }
    }
}

/// Bits of the difference between successive tokens. The database's 63 bits have room for 8 million maximum
/// differences.
const GAP_BITS: u32 = 40;

/// A random difference between the last token of a job and the next one, so that a token can't be guessed from others.
pub(crate) fn gap() -> i64 {
    let random = uuid::Uuid::new_v4().as_u128() & ((1 << GAP_BITS) - 1);
    random as i64 + 1
}

/// Gives a queued job to the worker; `None` if it is no longer queued, or its model has another trainer now.
pub(super) async fn begin(
    tx: &mut Tx,
    ask: &Ask<'_>,
    job_id: &str,
) -> Result<Option<LeaseKey>, StoreError> {
    start_lease_clock(tx).await?;
    let row = sql(
        "UPDATE jobs SET state = 'RUNNING', lease = last_token + $6, last_token = last_token + $6,
             worker = $2, lease_request = $3, lease_deadline = $4 + $5, sequence = sequence + 1, waiting_error = NULL,
             not_before = NULL, start_time = coalesce(start_time, $4)
         WHERE id = $1 AND state = 'QUEUED' AND NOT (kind = 'train' AND EXISTS (
             SELECT 1 FROM jobs r
             WHERE r.model = jobs.model AND r.kind = 'train' AND r.state = 'RUNNING'))
         RETURNING lease",
    )
    .bind(job_id)
    .bind(ask.worker_id)
    .bind((!ask.request_id.is_empty()).then_some(ask.request_id))
    .bind(tx.now())
    .bind(ask.lease_seconds)
    .bind(gap())
    .row(tx, "leasing a job")
    .await?;
    begin_attempt(tx, ask, job_id, row).await
}

/// The lease in the `row` of a statement that gave one, and its attempt; `None` without a row.
pub(super) async fn begin_attempt(
    tx: &mut Tx,
    ask: &Ask<'_>,
    job_id: &str,
    row: Option<Row>,
) -> Result<Option<LeaseKey>, StoreError> {
    let Some(row) = row else {
        return Ok(None);
    };
    let key = LeaseKey {
        job_id: job_id.to_owned(),
        worker_id: ask.worker_id.to_owned(),
        token: row.number("lease")?,
    };
    attempts::begin(tx, &key).await?;
    Ok(Some(key))
}

/// Chooses the checkpoint of a job that was just leased, finds its inputs, and asks for the consents of its people.
async fn inputs_of(tx: &mut Tx, ask: &Ask<'_>, key: &LeaseKey) -> Result<LeasedJob, StoreError> {
    // A render that has begun continues with the checkpoint that it began with.
    let begun = !outputs::list(tx, &key.job_id).await?.is_empty();
    if !begun && !ranges::any(tx, &key.job_id).await? {
        let spec = jobs::spec(tx, &key.job_id).await?;
        pins::renew(tx, ask.tenant, &key.job_id, &spec).await?;
    }
    let leased = leased(tx, ask.tenant, key).await?;
    // Last: the inputs pin people who have joined the model since the job was queued.
    consent_rule::check_job(tx, &key.job_id, ask.requires_consent).await?;
    Ok(leased)
}

/// Restarts the lease clock if no lease runs: the gap before the first lease is not an outage.
async fn start_lease_clock(tx: &mut Tx) -> Result<(), StoreError> {
    sql("INSERT INTO lease_clock (id, last_tick)
         SELECT 1, $1 WHERE NOT EXISTS (SELECT 1 FROM leases)
         ON CONFLICT (id) DO UPDATE SET last_tick = excluded.last_tick")
    .bind(tx.now())
    .execute(tx, "starting the lease clock")
    .await?;
    Ok(())
}

/// The lease of an earlier call with the same id, whose answer was lost. Its deadline is renewed, since the
/// worker counts from this call.
async fn again(tx: &mut Tx, ask: &Ask<'_>) -> Result<Option<LeasedJob>, StoreError> {
    if ask.request_id.is_empty() {
        return Ok(None);
    }
    let row = sql("UPDATE jobs SET lease_deadline = $3
         WHERE worker = $1 AND state = 'RUNNING' AND lease_request = $2 RETURNING id, lease")
    .bind(ask.worker_id)
    .bind(ask.request_id)
    .bind(tx.now() + ask.lease_seconds)
    .row(tx, "looking for the lease of an earlier call")
    .await?;
    let key = match row {
        Some(row) => LeaseKey {
            job_id: row.text("id")?,
            worker_id: ask.worker_id.to_owned(),
            token: row.number("lease")?,
        },
        None => match helpers::again(tx, ask).await? {
            Some(key) => key,
            None => return Ok(None),
        },
    };
    leased(tx, ask.tenant, &key).await.map(Some)
}

async fn leased(tx: &mut Tx, tenant: &Tenant, key: &LeaseKey) -> Result<LeasedJob, StoreError> {
    let job = jobs::get(tx, tenant, &key.job_id).await?;
    let spec = jobs::spec(tx, &key.job_id).await?;
    let inputs = inputs::resolve(tx, tenant, &key.job_id, &spec).await?;
    let runs = bound(guarded!("SELECT 1 FROM jobs"), key)?
        .row(tx, "checking a lease")
        .await?;
    Ok(LeasedJob {
        job,
        token: key.token,
        inputs,
        helps: runs.is_none(),
    })
}

/// Whether the lease is current: of the worker that runs the job, or of a helper.
pub(crate) async fn is_held(tx: &mut Tx, lease: &LeaseKey) -> Result<bool, StoreError> {
    let row = bound(held!("SELECT 1 FROM jobs"), lease)?
        .row(tx, "checking a lease")
        .await?;
    Ok(row.is_some())
}

/// Checks that the tenant has the job and the worker of a claim. A guarded write that matches no row after this has a stale
/// lease.
pub(crate) async fn require(
    tx: &mut Tx,
    tenant: &Tenant,
    lease: &LeaseKey,
) -> Result<(), StoreError> {
    tx.lock(Lock::Job(&lease.job_id)).await?;
    jobs::require(tx, tenant, &lease.job_id).await?;
    workers::require(tx, tenant, &lease.worker_id).await
}

/// The order of a leased job.
pub(crate) async fn spec(tx: &mut Tx, lease: &LeaseKey) -> Result<JobSpec, StoreError> {
    let row = bound(held!("SELECT spec FROM jobs"), lease)?
        .row(tx, "reading a leased job")
        .await?;
    match row {
        Some(row) => Ok(row.message("spec")?.unwrap_or_default()),
        None => Err(lease.stale()),
    }
}

/// Extends the lease of the worker that runs the job and records its progress, by one statement unless the progress has figures. One that
/// arrives late, after a later one by another connection, does not shorten the lease. Returns
/// whether the job is to be cancelled; `None` if that worker does not hold the lease: a helper may ([`helper_heartbeat`]).
pub(crate) async fn heartbeat(
    tx: &mut Tx,
    tenant: &Tenant,
    lease: &LeaseKey,
    progress: Option<&Progress>,
    lease_seconds: f64,
) -> Result<Option<bool>, StoreError> {
    macro_rules! reported {
        ($columns:expr) => {
            concat!(
                guarded!(
                    "UPDATE jobs SET lease_deadline = CASE WHEN lease_deadline > $4 THEN lease_deadline ELSE $4 END,
             sequence = sequence + CASE WHEN $5 IS NOT NULL AND progress IS DISTINCT FROM $5 THEN 1 ELSE 0 END,
             progress = coalesce($5, progress)",
                    "AND tenant = $6 RETURNING cancel_requested"
                ),
                $columns
            )
        };
    }
    let figures = progress.filter(|it| metrics::has_figures(it));
    let statement = match figures {
        None => reported!(""),
        Some(_) => reported!(concat!(", ", known_points!())),
    };
    let row = bound(statement, lease)?
        .bind(tx.now() + lease_seconds)
        .bind(progress.map(Message::encode_to_vec))
        .bind(tenant.id())
        .row(tx, "recording a heartbeat")
        .await?;
    let Some(row) = row else { return Ok(None) };
    let cancel = row.flag("cancel_requested")?;
    if let Some(progress) = figures {
        metrics::record(tx, &lease.job_id, progress, row).await?;
    }
    Ok(Some(cancel))
}

/// Extends the lease of a helper, whose progress is not recorded. Returns whether the job is to be cancelled.
pub(crate) async fn helper_heartbeat(
    tx: &mut Tx,
    tenant: &Tenant,
    lease: &LeaseKey,
    lease_seconds: f64,
) -> Result<bool, StoreError> {
    require(tx, tenant, lease).await?;
    helpers::heartbeat(tx, lease, lease_seconds).await
}

/// Records a checkpoint of the leased train job's model, and removes those that the model no longer keeps. The
/// count of lost workers starts again at 0.
pub(crate) async fn publish(
    tx: &mut Tx,
    lease: &LeaseKey,
    checkpoint: Checkpoint,
    default: Retention,
) -> Result<(), StoreError> {
    integer("checkpoint.step", checkpoint.step)?;
    let statement = guarded!(
        "UPDATE jobs SET losses = 0",
        "AND kind = 'train' RETURNING model"
    );
    let row = bound(statement, lease)?.row(tx, "checking a lease").await?;
    match row {
        Some(row) => {
            let model = row.text("model")?;
            tx.lock(Lock::Model(&model)).await?;
            checkpoints::record(tx, &model, &lease.job_id, checkpoint).await?;
            checkpoints::thin_out(tx, &model, default).await
        }
        None => Err(lease.stale()),
    }
}
