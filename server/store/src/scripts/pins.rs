//! The captures and checkpoints that open jobs use, and that therefore must stay.
//!
//! When a job is queued, each person that it needs is pinned to their newest capture, so that its result does
//! not depend on when a worker comes.
//!
//! A render, an evaluation or an export uses one checkpoint: the one that its order names, or the best one. It
//! is chosen when the job is queued, and again when it is leased, since a better one may have been published.
//! Between the two, the checkpoint that the order was checked with is kept. A scene with people of other models
//! also uses the best checkpoint of each of them, which is chosen and kept in the same way.

use super::checkpoints;
use crate::db::{Lock, Tx, integer, sql};
use crate::rules::best::to_use;
use crate::rules::retention::Pins;
use crate::{StoreError, Tenant};
use yoto_proto::names::Collection;
use yoto_proto::render_needs::{Need, needs, other_models};
use yoto_proto::v1::{ErrorReason, JobSpec, Model, job_spec};
use yoto_proto::{exports, tiers};

/// Step of the checkpoint that a job uses.
pub(crate) async fn of_job(tx: &mut Tx, job_id: &str) -> Result<Option<u64>, StoreError> {
    let row = sql("SELECT pinned_step FROM jobs WHERE id = $1")
        .bind(job_id)
        .row(tx, "reading which checkpoint a job uses")
        .await?;
    row.map_or(Ok(None), |row| row.maybe_number("pinned_step"))
}

/// Step of the checkpoint that a job uses of a model that is not its own.
pub(crate) async fn of_other(
    tx: &mut Tx,
    job_id: &str,
    model_id: &str,
) -> Result<Option<u64>, StoreError> {
    let row = sql("SELECT step FROM job_models WHERE job = $1 AND model = $2")
        .bind(job_id)
        .bind(model_id)
        .row(tx, "reading which checkpoint a job uses of another model")
        .await?;
    row.map(|row| row.number("step")).transpose()
}

/// The checkpoints of a model that open jobs use: jobs of the model, and scenes of other models that show its
/// people.
pub(crate) async fn of_model(tx: &mut Tx, model_id: &str) -> Result<Pins, StoreError> {
    let rows = sql(
        "SELECT ord, id, pinned_step FROM jobs
         WHERE state IN ('QUEUED', 'RUNNING') AND model = $1 AND kind IN ('render', 'evaluate', 'export')
         UNION ALL
         SELECT j.ord, j.id, m.step FROM job_models m JOIN jobs j ON j.id = m.job
         WHERE m.model = $1 AND j.state IN ('QUEUED', 'RUNNING')
         ORDER BY 1",
    )
    .bind(model_id)
    .rows(tx, "reading which checkpoints are in use").await?;
    let mut pins = Pins::default();
    for row in &rows {
        let job = Collection::Jobs.name(&row.text("id")?);
        match row.maybe_number("pinned_step")? {
            Some(step) => drop(pins.steps.entry(step).or_insert(job)),
            None => drop(pins.all.get_or_insert(job)),
        }
    }
    Ok(pins)
}

/// Step of the checkpoint that a job with this order uses, which must exist; `None` for jobs that do not use a
/// particular one.
pub(crate) async fn chosen(
    tx: &mut Tx,
    tenant: &Tenant,
    spec: &JobSpec,
) -> Result<Option<i64>, StoreError> {
    let (model, wanted, tradeoff) = match &spec.kind {
        Some(job_spec::Kind::Render(it)) => {
            let tradeoff = it.quality.as_ref().is_some_and(tiers::needs_tradeoff);
            (&it.model, &it.checkpoint, tradeoff)
        }
        Some(job_spec::Kind::Evaluate(it)) => (&it.model, &it.checkpoint, false),
        Some(job_spec::Kind::Export(it)) => (&it.model, &it.checkpoint, false),
        Some(job_spec::Kind::Ingest(_) | job_spec::Kind::Train(_)) | None => return Ok(None),
    };
    step_of(tx, tenant, model, wanted, tradeoff).await.map(Some)
}

/// Step of the checkpoint of `model` that a job uses: the one with the name `wanted`, or the best one.
async fn step_of(
    tx: &mut Tx,
    tenant: &Tenant,
    model: &str,
    wanted: &str,
    tradeoff: bool,
) -> Result<i64, StoreError> {
    let all = checkpoints::list(tx, tenant, model_id(model)?, u32::MAX).await?;
    let Some(used) = to_use(all, wanted, tradeoff).into_iter().next() else {
        return Err(StoreError::Rule {
            reason: ErrorReason::NoCheckpoint,
            message: format!("the checkpoint of {model} to use was removed meanwhile"),
        });
    };
    integer("checkpoint.step", used.step)
}

fn model_id(name: &str) -> Result<&str, StoreError> {
    let id = Collection::Models.parse(name);
    id.map_err(|error| StoreError::Corrupt {
        what: "spec",
        detail: error.to_string(),
    })
}

/// The model of a job that uses a checkpoint of it, `models/{id}`.
fn own(spec: &JobSpec) -> Option<&str> {
    match &spec.kind {
        Some(job_spec::Kind::Render(it)) => Some(&it.model),
        Some(job_spec::Kind::Evaluate(it)) => Some(&it.model),
        Some(job_spec::Kind::Export(it)) => Some(&it.model),
        Some(job_spec::Kind::Ingest(_) | job_spec::Kind::Train(_)) | None => None,
    }
}

/// The models beside its own that a job uses, `models/{id}`, in the order of its actors.
pub(crate) fn others(spec: &JobSpec) -> Vec<&str> {
    match &spec.kind {
        Some(job_spec::Kind::Render(render)) => {
            let others = other_models(render).into_iter();
            others.map(|(_, model)| model).collect()
        }
        _ => Vec::new(),
    }
}

/// Locks the models of a job with this order: `model_id`, which is its own, and the others.
pub(crate) async fn lock_models(
    tx: &mut Tx,
    model_id: &str,
    spec: &JobSpec,
) -> Result<(), StoreError> {
    let mut ids = vec![model_id];
    for name in others(spec) {
        ids.push(self::model_id(name)?);
    }
    ids.sort_unstable();
    for id in ids {
        tx.lock(Lock::Model(id)).await?;
    }
    Ok(())
}

/// Chooses the checkpoint of each other model that a job uses. Each of these models must have one.
pub(crate) async fn pin_others(
    tx: &mut Tx,
    tenant: &Tenant,
    job_id: &str,
    spec: &JobSpec,
) -> Result<(), StoreError> {
    for model in others(spec) {
        let step = step_of(tx, tenant, model, "", false).await?;
        sql(
            "INSERT INTO job_models (job, model, step) VALUES ($1, $2, $3)
             ON CONFLICT (job, model) DO UPDATE SET step = excluded.step",
        )
        .bind(job_id)
        .bind(model_id(model)?)
        .bind(step)
        .execute(tx, "recording which checkpoint a job uses of another model")
        .await?;
    }
    Ok(())
}

/// Chooses the checkpoints of a leased job again.
pub(crate) async fn renew(
    tx: &mut Tx,
    tenant: &Tenant,
    job_id: &str,
    spec: &JobSpec,
) -> Result<(), StoreError> {
    if let Some(own) = own(spec) {
        lock_models(tx, model_id(own)?, spec).await?;
    }
    let step = match chosen(tx, tenant, spec).await {
        Ok(Some(step)) => step,
        // The worker finds no checkpoint and says so.
        Ok(None) | Err(StoreError::Rule { .. }) => return Ok(()),
        Err(error) => return Err(error),
    };
    sql("UPDATE jobs SET pinned_step = $2 WHERE id = $1")
        .bind(job_id)
        .bind(step)
        .execute(tx, "recording which checkpoint a job uses")
        .await?;
    pin_others(tx, tenant, job_id, spec).await
}

/// The people that a job on `model` needs, `subjects/{id}`, each once.
pub(crate) fn people(spec: &JobSpec, model: &Model) -> Vec<String> {
    let everybody = model.slots.iter().map(|it| it.subject.clone());
    match &spec.kind {
        // Nobody's frames are needed to take a person out.
        Some(job_spec::Kind::Train(it)) if !it.leave.is_empty() => Vec::new(),
        Some(job_spec::Kind::Train(it)) => everybody
            .filter(|subject| it.only.is_empty() || it.only == *subject)
            .collect(),
        Some(job_spec::Kind::Evaluate(it)) => everybody
            .filter(|subject| it.subjects.is_empty() || it.subjects.contains(subject))
            .collect(),
        Some(job_spec::Kind::Render(render)) => each_once(needs(render)),
        Some(job_spec::Kind::Export(export)) => each_once(exports::needs(export)),
        Some(job_spec::Kind::Ingest(_)) | None => Vec::new(),
    }
}

/// The subjects of `needs`, each once.
fn each_once(needs: Vec<Need<'_>>) -> Vec<String> {
    let mut people: Vec<String> = Vec::new();
    for need in needs {
        if !people.iter().any(|it| it == need.subject) {
            people.push(need.subject.to_owned());
        }
    }
    people
}

/// Pins the newest capture of a person to a job; the capture's id.
pub(crate) async fn pin_capture(
    tx: &mut Tx,
    tenant: &Tenant,
    job_id: &str,
    subject_id: &str,
) -> Result<String, StoreError> {
    let row = sql("INSERT INTO job_captures (job, subject, capture)
         SELECT $1, $2, c.id FROM captures c JOIN subjects s ON s.id = c.subject
         WHERE c.subject = $2 AND s.tenant = $3 AND c.state = 'READY'
         ORDER BY c.ord DESC LIMIT 1
         RETURNING capture")
    .bind(job_id)
    .bind(subject_id)
    .bind(tenant.id())
    .row(tx, "choosing a capture for a job")
    .await?;
    match row {
        Some(row) => row.text("capture"),
        None => Err(StoreError::Rule {
            reason: ErrorReason::NoCapture,
            message: format!(
                "{} has no READY capture",
                Collection::Subjects.name(subject_id)
            ),
        }),
    }
}

/// The capture of a person that was chosen for a job.
pub(crate) async fn capture(
    tx: &mut Tx,
    job_id: &str,
    subject_id: &str,
) -> Result<Option<String>, StoreError> {
    let row = sql("SELECT capture FROM job_captures WHERE job = $1 AND subject = $2")
        .bind(job_id)
        .bind(subject_id)
        .row(tx, "reading which capture a job uses")
        .await?;
    row.map(|row| row.text("capture")).transpose()
}

/// An open job of the model or with people of it; only of `kind` if that is not empty.
pub(crate) async fn open_job(
    tx: &mut Tx,
    model_id: &str,
    kind: &str,
) -> Result<Option<String>, StoreError> {
    let row = sql("SELECT id FROM jobs WHERE state IN ('QUEUED', 'RUNNING')
             AND (model = $1 OR id IN (SELECT job FROM job_models WHERE model = $1))
             AND ($2 = '' OR kind = $2) ORDER BY ord LIMIT 1")
    .bind(model_id)
    .bind(kind)
    .row(tx, "looking for jobs of a model")
    .await?;
    row.map(|row| Ok(Collection::Jobs.name(&row.text("id")?)))
        .transpose()
}

/// Refuses if a job of the model, or with people of it, is open.
pub(crate) async fn ensure_idle(tx: &mut Tx, model: &Model) -> Result<(), StoreError> {
    match open_job(tx, model_id(&model.name)?, "").await? {
        Some(job) => Err(in_use(&job, &model.display_name, ErrorReason::ModelBusy)),
        None => Ok(()),
    }
}

/// The refusal that names the job.
pub(crate) fn in_use(job: &str, what: &str, reason: ErrorReason) -> StoreError {
    let message = format!("{job} uses {what}: wait for it, or cancel it");
    StoreError::Rule { reason, message }
}
