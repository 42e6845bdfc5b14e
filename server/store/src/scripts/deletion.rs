//! Deletions: rows go at once, objects are noted as garbage in the same transaction.
//!
//! A resource that an open job uses is not deleted; the refusal names the job. A person in a model is not
//! deleted either: the model's checkpoints would still contain what was learned from them, with no record of
//! that person left.

use super::{
    captures, checkpoints, erasures, garbage, jobs, models, pins, requests, subjects, uploads,
};
use crate::db::{Lock, Tx, sql};
use crate::rules::etag;
use crate::{RequestKey, StoreError, Target, Tenant};
use yoto_proto::names::{self, Collection};
use yoto_proto::render_needs::needs;
use yoto_proto::v1::{Capture, Deleted, ErrorReason, JobSpec, capture, job, job_result, job_spec};
use yoto_proto::{exports, keys};

/// Deletes `target` with everything that depends on it if its version is `etag` (empty: any). A repeated
/// `request` gets its first answer.
pub(crate) async fn delete(
    tx: &mut Tx,
    tenant: &Tenant,
    target: Target<'_>,
    etag: &str,
    request: Option<RequestKey>,
) -> Result<Deleted, StoreError> {
    if let Some(answer) = requests::begin(tx, tenant, request.as_ref()).await? {
        return counted(&answer);
    }
    let deleted = match target {
        Target::Subject(id) => subject(tx, tenant, id, etag).await,
        Target::Capture(id) => capture(tx, tenant, id, etag).await,
        Target::Model(id) => model(tx, tenant, id, etag).await,
        Target::Checkpoint { model, step } => checkpoint(tx, tenant, model, step, etag).await,
        Target::Job(id) => job(tx, tenant, id, etag).await,
    }?;
    let Deleted {
        captures,
        checkpoints,
        jobs,
    } = deleted;
    let answer = format!("{captures} {checkpoints} {jobs}");
    requests::remember(tx, tenant, request.as_ref(), &answer).await?;
    Ok(deleted)
}

/// The numbers in a stored answer.
fn counted(answer: &str) -> Result<Deleted, StoreError> {
    let numbers: Result<Vec<u32>, _> = answer.split(' ').map(str::parse).collect();
    match numbers.as_deref() {
        Ok(&[captures, checkpoints, jobs]) => Ok(Deleted {
            captures,
            checkpoints,
            jobs,
        }),
        _ => Err(StoreError::Corrupt {
            what: "request_ids.answer",
            detail: answer.to_owned(),
        }),
    }
}

fn refuse(reason: ErrorReason, message: String) -> StoreError {
    StoreError::Rule { reason, message }
}

async fn checkpoint(
    tx: &mut Tx,
    tenant: &Tenant,
    model_id: &str,
    step: u64,
    etag: &str,
) -> Result<Deleted, StoreError> {
    tx.lock(Lock::Model(model_id)).await?;
    let all = checkpoints::list(tx, tenant, model_id, u32::MAX).await?;
    let name = names::checkpoint(&Collection::Models.name(model_id), step);
    let Some(found) = all.iter().find(|it| it.step == step) else {
        return Err(StoreError::NotFound { name });
    };
    etag::check(&name, etag, &found.etag)?;
    if let Some(alias) = found.aliases.first() {
        let message =
            format!("{name} is called {alias}: give the alias to another one, or remove it first");
        return Err(refuse(ErrorReason::CheckpointBusy, message));
    }
    let used = pins::of_model(tx, model_id).await?;
    let newest = all.first().is_some_and(|it| it.step == step);
    let mut job = used.steps.get(&step).or(used.all.as_ref()).cloned();
    if job.is_none() && newest {
        // A training resumes from it.
        job = pins::open_job(tx, model_id, "train").await?;
    }
    if let Some(job) = job {
        return Err(pins::in_use(&job, &name, ErrorReason::CheckpointBusy));
    }
    checkpoints::remove(tx, model_id, step).await?;
    Ok(Deleted {
        checkpoints: 1,
        ..Deleted::default()
    })
}

async fn model(tx: &mut Tx, tenant: &Tenant, id: &str, etag: &str) -> Result<Deleted, StoreError> {
    tx.lock(Lock::Model(id)).await?;
    let model = models::get(tx, tenant, id).await?;
    etag::check(&model.name, etag, &model.etag)?;
    pins::ensure_idle(tx, &model).await?;
    let rows = sql("SELECT id FROM jobs WHERE model = $1 AND kind IN ('render', 'export')")
        .bind(id)
        .rows(tx, "listing a model's renders and exports")
        .await?;
    for row in &rows {
        garbage::deleted(tx, &format!("renders/{}", row.text("id")?)).await?;
    }
    garbage::deleted(tx, &format!("models/{id}")).await?;
    let checkpoints = run(tx, "DELETE FROM checkpoints WHERE model = $1", id).await?;
    let jobs = run(tx, "DELETE FROM jobs WHERE model = $1", id).await?;
    run(tx, "DELETE FROM slots WHERE model = $1", id).await?;
    run(tx, "DELETE FROM models WHERE id = $1", id).await?;
    Ok(Deleted {
        checkpoints,
        jobs,
        captures: 0,
    })
}

async fn job(tx: &mut Tx, tenant: &Tenant, id: &str, etag: &str) -> Result<Deleted, StoreError> {
    tx.lock(Lock::Job(id)).await?;
    let job = jobs::get(tx, tenant, id).await?;
    etag::check(&job.name, etag, &job.etag)?;
    if matches!(job.state(), job::State::Queued | job::State::Running) {
        let message = format!(
            "{} is {}: cancel it first, or wait for it",
            job.name,
            job.state().as_str_name()
        );
        return Err(refuse(ErrorReason::JobOpen, message));
    }
    garbage::deleted(tx, &format!("renders/{id}")).await?;
    if let Some(job_result::Kind::Evaluate(result)) = job.result.and_then(|it| it.kind)
        && let Some(tradeoff) = result.tradeoff
    {
        garbage::deleted(tx, keys::folder(&tradeoff.key)).await?;
    }
    let jobs = run(tx, "DELETE FROM jobs WHERE id = $1", id).await?;
    Ok(Deleted {
        jobs,
        ..Deleted::default()
    })
}

async fn capture(
    tx: &mut Tx,
    tenant: &Tenant,
    id: &str,
    etag: &str,
) -> Result<Deleted, StoreError> {
    // A capture never changes its person.
    let subject = captures::subject_id(&captures::get(tx, tenant, id).await?)?.to_owned();
    tx.lock(Lock::Subject(&subject)).await?;
    tx.lock(Lock::Capture(id)).await?;
    let capture = captures::get(tx, tenant, id).await?;
    etag::check(&capture.name, etag, &capture.etag)?;
    if capture.state() == capture::State::Ready {
        let others = sql(
            "SELECT id FROM captures WHERE subject = $1 AND state = 'READY' AND id <> $2 LIMIT 1",
        )
        .bind(&subject)
        .bind(id)
        .row(tx, "looking for other captures")
        .await?;
        if others.is_none()
            && let Some(model) = model_of(tx, &subject).await?
        {
            let message = format!(
                "{model} can neither train nor render its person without {}: upload another \
                 capture first, or delete the model",
                capture.name
            );
            return Err(refuse(ErrorReason::CaptureInModel, message));
        }
        ensure_unused(tx, tenant, &subject, &capture.name).await?;
    }
    remove_capture(tx, id, &capture).await
}

async fn subject(
    tx: &mut Tx,
    tenant: &Tenant,
    id: &str,
    etag: &str,
) -> Result<Deleted, StoreError> {
    tx.lock(Lock::Subject(id)).await?;
    let subject = subjects::get(tx, tenant, id).await?;
    etag::check(&subject.display_name, etag, &subject.etag)?;
    let person = &subject.display_name;
    erasures::refuse_if_begun(tx, id).await?;
    if let Some(model) = model_of(tx, id).await? {
        let message = format!(
            "{person} is in {model}, whose checkpoints hold what it has learned of them: delete the \
             model first, or take them out if it was not trained with them yet"
        );
        return Err(refuse(ErrorReason::SubjectInModel, message));
    }
    ensure_unused(tx, tenant, id, person).await?;
    let mut deleted = Deleted::default();
    let mut captures = subject.captures;
    captures.sort();
    for name in &captures {
        let capture_id = name.strip_prefix("captures/").unwrap_or(name);
        tx.lock(Lock::Capture(capture_id)).await?;
        let capture = captures::get(tx, tenant, capture_id).await?;
        let of_it = remove_capture(tx, capture_id, &capture).await?;
        deleted.captures += of_it.captures;
        deleted.jobs += of_it.jobs;
    }
    run(tx, "DELETE FROM subjects WHERE id = $1", id).await?;
    Ok(deleted)
}

/// Deletes a capture with its ingest jobs, unless one is open. An open upload ends.
pub(super) async fn remove_capture(
    tx: &mut Tx,
    id: &str,
    capture: &Capture,
) -> Result<Deleted, StoreError> {
    if capture.state() == capture::State::Ingesting {
        return Err(pins::in_use(
            &capture.ingest_job,
            &capture.name,
            ErrorReason::CaptureBusy,
        ));
    }
    uploads::forget(tx, id).await?;
    garbage::deleted(tx, &format!("captures/{id}")).await?;
    let jobs = run(tx, "DELETE FROM jobs WHERE capture = $1", id).await?;
    let captures = run(tx, "DELETE FROM captures WHERE id = $1", id).await?;
    Ok(Deleted {
        captures,
        jobs,
        checkpoints: 0,
    })
}

/// Name of a model that has the subject.
async fn model_of(tx: &mut Tx, subject_id: &str) -> Result<Option<String>, StoreError> {
    let row = sql(
        "SELECT m.display_name FROM slots s JOIN models m ON m.id = s.model
         WHERE s.subject = $1 ORDER BY m.ord LIMIT 1",
    )
    .bind(subject_id)
    .row(tx, "looking for models of a subject")
    .await?;
    row.map(|row| row.text("display_name")).transpose()
}

/// Refuses if an open job uses the subject: in its model, or as the source of a motion.
async fn ensure_unused(
    tx: &mut Tx,
    tenant: &Tenant,
    subject_id: &str,
    what: &str,
) -> Result<(), StoreError> {
    let rows = sql(
        "SELECT j.id, j.spec, EXISTS (SELECT 1 FROM slots s
             WHERE s.model = j.model AND s.subject = $1) AS has_slot
         FROM jobs j WHERE j.state IN ('QUEUED', 'RUNNING') AND j.tenant = $2 AND j.kind <> 'ingest' ORDER BY j.ord",
    )
    .bind(subject_id)
    .bind(tenant.id())
    .rows(tx, "looking for jobs of a subject").await?;
    let name = Collection::Subjects.name(subject_id);
    for row in &rows {
        let spec: Option<JobSpec> = row.message("spec")?;
        if row.flag("has_slot")? || spec.is_some_and(|spec| is_needed(&spec, &name)) {
            let job = Collection::Jobs.name(&row.text("id")?);
            return Err(pins::in_use(&job, what, ErrorReason::SubjectBusy));
        }
    }
    Ok(())
}

/// Whether a render or an export needs the capture of `subject`.
fn is_needed(spec: &JobSpec, subject: &str) -> bool {
    let needs = match &spec.kind {
        Some(job_spec::Kind::Render(render)) => needs(render),
        Some(job_spec::Kind::Export(export)) => exports::needs(export),
        _ => return false,
    };
    needs.iter().any(|need| need.subject == subject)
}

/// Runs a statement on `id`; the number of rows.
async fn run(tx: &mut Tx, statement: &'static str, id: &str) -> Result<u32, StoreError> {
    let done = sql(statement).bind(id).execute(tx, "deleting rows").await?;
    Ok(u32::try_from(done).unwrap_or(u32::MAX))
}
