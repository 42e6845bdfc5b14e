//! A person leaves the models that they are in: a job of each model writes its checkpoints anew without them.

use super::{checkpoints, consent_rule, erasures, jobs, models, outcome};
use crate::db::{Lock, Tx, sql};
use crate::{LeaseKey, Leaving, NewJob, OpenErasure, StoreError, Tenant};
use yoto_proto::names::Collection;
use yoto_proto::v1::{
    Checkpoint, Job, JobError, JobPriority, JobSpec, Model, TrainSpec, job, job_spec,
};

/// Open ingest jobs of a person's captures.
pub(crate) async fn ingests(tx: &mut Tx, subject_id: &str) -> Result<Vec<String>, StoreError> {
    let rows = sql("SELECT j.id FROM jobs j JOIN captures c ON c.id = j.capture
         WHERE c.subject = $1 AND j.state IN ('QUEUED', 'RUNNING') ORDER BY j.ord")
    .bind(subject_id)
    .rows(tx, "looking for open ingest jobs")
    .await?;
    rows.iter().map(|row| row.text("id")).collect()
}

/// Ends an open ingest job without waiting for its worker.
pub(crate) async fn stop_ingest(tx: &mut Tx, job_id: &str) -> Result<(), StoreError> {
    tx.lock(Lock::Job(job_id)).await?;
    let job = sql("SELECT state, worker, lease FROM jobs WHERE id = $1")
        .bind(job_id)
        .row(tx, "reading an ingest job")
        .await?;
    let Some(job) = job else {
        return Ok(());
    };
    if outcome::cancel_queued(tx, job_id).await? || job.text("state")? != "RUNNING" {
        return Ok(());
    }
    let lease = LeaseKey {
        job_id: job_id.to_owned(),
        worker_id: job.maybe_text("worker")?.unwrap_or_default(),
        token: job.number("lease")?,
    };
    let error: JobError = consent_rule::job_error("its person is being erased".to_owned());
    outcome::stop(tx, &lease, &error).await
}

/// The models with a slot of the person.
pub(crate) async fn models_of(tx: &mut Tx, subject_id: &str) -> Result<Vec<String>, StoreError> {
    let rows = sql("SELECT model FROM slots WHERE subject = $1 ORDER BY model")
        .bind(subject_id)
        .rows(tx, "looking for models of a person")
        .await?;
    rows.iter().map(|row| row.text("model")).collect()
}

/// Whether a checkpoint was trained with the slot; one of an earlier version was trained with all.
pub(crate) fn knows(checkpoint: &Checkpoint, slot: u32) -> bool {
    checkpoint.slots.is_empty() || checkpoint.slots.contains(&slot)
}

/// Whether a checkpoint of `model` is written anew without the slot: it has somebody else, for whom it is kept.
pub(crate) fn is_rewritten(checkpoint: &Checkpoint, model: &Model, slot: u32) -> bool {
    let has_others = match checkpoint.slots.is_empty() {
        true => model.slots.iter().any(|it| it.slot != slot),
        false => checkpoint.slots.iter().any(|it| *it != slot),
    };
    knows(checkpoint, slot) && has_others
}

/// The slot of a person in a model.
pub(crate) fn slot_of(model: &Model, subject_id: &str) -> Option<u32> {
    let name = Collection::Subjects.name(subject_id);
    let slot = model.slots.iter().find(|it| it.subject == name);
    slot.map(|it| it.slot)
}

/// The job that takes the person out of a model, which is queued if it is needed and there is none yet.
pub(crate) async fn leave(
    tx: &mut Tx,
    erasure: &OpenErasure,
    model_id: &str,
) -> Result<Leaving, StoreError> {
    let tenant = &erasure.tenant;
    tx.lock(Lock::Model(model_id)).await?;
    let model = models::get(tx, tenant, model_id).await?;
    let Some(slot) = slot_of(&model, &erasure.subject_id) else {
        return Ok(Leaving::Done);
    };
    if let Some(job) = job_of(tx, tenant, &erasure.id, model_id).await? {
        return Ok(match job.state() {
            job::State::Succeeded => Leaving::Done,
            job::State::Failed | job::State::Cancelled => Leaving::Failed {
                why: job.error.unwrap_or_default().message,
                job: job.name,
            },
            _ => Leaving::Waits { job: job.name },
        });
    }
    let all = checkpoints::list(tx, tenant, model_id, u32::MAX).await?;
    if !all.iter().any(|it| is_rewritten(it, &model, slot)) {
        return Ok(Leaving::Done);
    }
    let order = TrainSpec {
        model: model.name,
        leave: Collection::Subjects.name(&erasure.subject_id),
        ..TrainSpec::default()
    };
    let new = NewJob {
        spec: JobSpec {
            kind: Some(job_spec::Kind::Train(order)),
        },
        priority: NewJob::column(JobPriority::Urgent),
        owner: String::new(),
        trace_parent: None,
    };
    let job = jobs::insert(tx, tenant, new).await?;
    sql(
        "INSERT INTO erasure_models (erasure, model, job) VALUES ($1, $2, $3)
         ON CONFLICT (erasure, model) DO UPDATE SET job = excluded.job",
    )
    .bind(&erasure.id)
    .bind(model_id)
    .bind(&job)
    .execute(tx, "noting the job of an erasure")
    .await?;
    erasures::wait(tx, &erasure.id, "").await?;
    Ok(Leaving::Queued {
        job: Collection::Jobs.name(&job),
    })
}

/// The job that takes the person of an erasure out of a model, if it still exists.
pub(crate) async fn job_of(
    tx: &mut Tx,
    tenant: &Tenant,
    erasure_id: &str,
    model_id: &str,
) -> Result<Option<Job>, StoreError> {
    let row = sql(
        "SELECT e.job FROM erasure_models e JOIN jobs j ON j.id = e.job
         WHERE e.erasure = $1 AND e.model = $2",
    )
    .bind(erasure_id)
    .bind(model_id)
    .row(tx, "reading the job of an erasure")
    .await?;
    match row {
        Some(row) => Ok(Some(
            jobs::without_order(tx, tenant, &row.text("job")?).await?,
        )),
        None => Ok(None),
    }
}
