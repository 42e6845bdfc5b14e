//! Deletions: rows go at once, objects are noted as garbage in the same transaction.
//!
//! A resource that an open job uses is not deleted; the refusal names the job. A person in a model is not
//! deleted either: the model's checkpoints would still contain what was learned from them, with no record of
//! that person left.

use super::rows::{Columns, During};
use super::{captures, checkpoints, garbage, jobs, models, pins, requests, subjects, uploads};
use crate::rules::etag;
use crate::store::{RequestKey, StoreError, Target};
use sqlx::SqliteConnection;
use yoto_proto::names::{self, Collection};
use yoto_proto::render_needs::needs;
use yoto_proto::v1::{Capture, Deleted, ErrorReason, JobSpec, capture, job, job_result, job_spec};
use yoto_proto::{exports, keys};

/// Deletes `target` with everything that depends on it if its version is `etag` (empty: any). A repeated
/// `request` gets its first answer.
pub async fn delete(
    conn: &mut SqliteConnection,
    target: Target<'_>,
    etag: &str,
    request: Option<RequestKey>,
    now: f64,
) -> Result<Deleted, StoreError> {
    if let Some(answer) = requests::answered(conn, request.as_ref()).await? {
        return counted(&answer);
    }
    let deleted = match target {
        Target::Subject(id) => subject(conn, id, etag, now).await,
        Target::Capture(id) => capture(conn, id, etag, now).await,
        Target::Model(id) => model(conn, id, etag, now).await,
        Target::Checkpoint { model, step } => checkpoint(conn, model, step, etag, now).await,
        Target::Job(id) => job(conn, id, etag, now).await,
    }?;
    let Deleted {
        captures,
        checkpoints,
        jobs,
    } = deleted;
    let answer = format!("{captures} {checkpoints} {jobs}");
    requests::remember(conn, request.as_ref(), &answer, now).await?;
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
    conn: &mut SqliteConnection,
    model_id: &str,
    step: u64,
    etag: &str,
    now: f64,
) -> Result<Deleted, StoreError> {
    let all = checkpoints::list(conn, model_id, u32::MAX).await?;
    let name = names::checkpoint(&Collection::Models.name(model_id), step);
    let Some(found) = all.iter().find(|it| it.step == step) else {
        return Err(StoreError::NotFound { name });
    };
    etag::check(&name, etag, &found.etag)?;
    let used = pins::of_model(conn, model_id).await?;
    let newest = all.first().is_some_and(|it| it.step == step);
    let mut job = used.steps.get(&step).or(used.all.as_ref()).cloned();
    if job.is_none() && newest {
        // A training resumes from it.
        job = pins::open_job(conn, model_id, "train").await?;
    }
    if let Some(job) = job {
        return Err(pins::in_use(&job, &name, ErrorReason::CheckpointBusy));
    }
    checkpoints::remove(conn, model_id, step, now).await?;
    Ok(Deleted {
        checkpoints: 1,
        ..Deleted::default()
    })
}

async fn model(
    conn: &mut SqliteConnection,
    id: &str,
    etag: &str,
    now: f64,
) -> Result<Deleted, StoreError> {
    let model = models::get(conn, id).await?;
    etag::check(&model.name, etag, &model.etag)?;
    pins::ensure_idle(conn, &model).await?;
    let rows = sqlx::query("SELECT id FROM jobs WHERE model = ?1 AND kind IN ('render', 'export')")
        .bind(id)
        .fetch_all(&mut *conn)
        .await
        .during("listing a model's renders and exports")?;
    for row in &rows {
        garbage::deleted(conn, &format!("renders/{}", row.text("id")?), now).await?;
    }
    garbage::deleted(conn, &format!("models/{id}"), now).await?;
    let checkpoints = run(conn, "DELETE FROM checkpoints WHERE model = ?1", id).await?;
    let jobs = run(conn, "DELETE FROM jobs WHERE model = ?1", id).await?;
    run(conn, "DELETE FROM slots WHERE model = ?1", id).await?;
    run(conn, "DELETE FROM models WHERE id = ?1", id).await?;
    Ok(Deleted {
        checkpoints,
        jobs,
        captures: 0,
    })
}

async fn job(
    conn: &mut SqliteConnection,
    id: &str,
    etag: &str,
    now: f64,
) -> Result<Deleted, StoreError> {
    let job = jobs::get(conn, id).await?;
    etag::check(&job.name, etag, &job.etag)?;
    if matches!(job.state(), job::State::Queued | job::State::Running) {
        let message = format!(
            "{} is {}: cancel it first, or wait for it",
            job.name,
            job.state().as_str_name()
        );
        return Err(refuse(ErrorReason::JobOpen, message));
    }
    garbage::deleted(conn, &format!("renders/{id}"), now).await?;
    if let Some(job_result::Kind::Evaluate(result)) = job.result.and_then(|it| it.kind)
        && let Some(tradeoff) = result.tradeoff
    {
        garbage::deleted(conn, keys::folder(&tradeoff.key), now).await?;
    }
    let jobs = run(conn, "DELETE FROM jobs WHERE id = ?1", id).await?;
    Ok(Deleted {
        jobs,
        ..Deleted::default()
    })
}

async fn capture(
    conn: &mut SqliteConnection,
    id: &str,
    etag: &str,
    now: f64,
) -> Result<Deleted, StoreError> {
    let capture = captures::get(conn, id).await?;
    etag::check(&capture.name, etag, &capture.etag)?;
    let subject = captures::subject_id(&capture)?.to_owned();
    if capture.state() == capture::State::Ready {
        let others = sqlx::query(
            "SELECT id FROM captures WHERE subject = ?1 AND state = 'READY' AND id <> ?2 LIMIT 1",
        )
        .bind(&subject)
        .bind(id)
        .fetch_optional(&mut *conn)
        .await
        .during("looking for other captures")?;
        if others.is_none()
            && let Some(model) = model_of(conn, &subject).await?
        {
            let message = format!(
                "{model} can neither train nor render its person without {}: upload another \
                 capture first, or delete the model",
                capture.name
            );
            return Err(refuse(ErrorReason::CaptureInModel, message));
        }
        ensure_unused(conn, &subject, &capture.name).await?;
    }
    remove_capture(conn, id, &capture, now).await
}

async fn subject(
    conn: &mut SqliteConnection,
    id: &str,
    etag: &str,
    now: f64,
) -> Result<Deleted, StoreError> {
    let subject = subjects::get(conn, id).await?;
    etag::check(&subject.display_name, etag, &subject.etag)?;
    let person = &subject.display_name;
    if let Some(model) = model_of(conn, id).await? {
        let message = format!(
            "{person} is in {model}, whose checkpoints hold what it has learned of them: delete the \
             model first, or take them out if it was not trained with them yet"
        );
        return Err(refuse(ErrorReason::SubjectInModel, message));
    }
    ensure_unused(conn, id, person).await?;
    let mut deleted = Deleted::default();
    for name in &subject.captures {
        let capture_id = name.strip_prefix("captures/").unwrap_or(name);
        let capture = captures::get(conn, capture_id).await?;
        let of_it = remove_capture(conn, capture_id, &capture, now).await?;
        deleted.captures += of_it.captures;
        deleted.jobs += of_it.jobs;
    }
    run(conn, "DELETE FROM subjects WHERE id = ?1", id).await?;
    Ok(deleted)
}

/// Deletes a capture with its ingest jobs, unless one is open. An open upload ends.
async fn remove_capture(
    conn: &mut SqliteConnection,
    id: &str,
    capture: &Capture,
    now: f64,
) -> Result<Deleted, StoreError> {
    if capture.state() == capture::State::Ingesting {
        return Err(pins::in_use(
            &capture.ingest_job,
            &capture.name,
            ErrorReason::CaptureBusy,
        ));
    }
    uploads::forget(conn, id, now).await?;
    garbage::deleted(conn, &format!("captures/{id}"), now).await?;
    let jobs = run(conn, "DELETE FROM jobs WHERE capture = ?1", id).await?;
    let captures = run(conn, "DELETE FROM captures WHERE id = ?1", id).await?;
    Ok(Deleted {
        captures,
        jobs,
        checkpoints: 0,
    })
}

/// Name of a model that has the subject.
async fn model_of(
    conn: &mut SqliteConnection,
    subject_id: &str,
) -> Result<Option<String>, StoreError> {
    let row = sqlx::query(
        "SELECT m.display_name FROM slots s JOIN models m ON m.id = s.model
         WHERE s.subject = ?1 ORDER BY m.ord LIMIT 1",
    )
    .bind(subject_id)
    .fetch_optional(conn)
    .await
    .during("looking for models of a subject")?;
    row.map(|row| row.text("display_name")).transpose()
}

/// Refuses if an open job uses the subject: in its model, or as the source of a motion.
async fn ensure_unused(
    conn: &mut SqliteConnection,
    subject_id: &str,
    what: &str,
) -> Result<(), StoreError> {
    let rows = sqlx::query(
        "SELECT j.id, j.spec, EXISTS (SELECT 1 FROM slots s
             WHERE s.model = j.model AND s.subject = ?1) AS has_slot
         FROM jobs j WHERE j.state IN ('QUEUED', 'RUNNING') AND j.kind <> 'ingest' ORDER BY j.ord",
    )
    .bind(subject_id)
    .fetch_all(conn)
    .await
    .during("looking for jobs of a subject")?;
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
async fn run(
    conn: &mut SqliteConnection,
    statement: &'static str,
    id: &str,
) -> Result<u32, StoreError> {
    let done = sqlx::query(statement)
        .bind(id)
        .execute(conn)
        .await
        .during("deleting rows")?;
    Ok(u32::try_from(done.rows_affected()).unwrap_or(u32::MAX))
}
