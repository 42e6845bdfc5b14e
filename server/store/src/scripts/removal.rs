//! Removes the rows of a person, once no job needs them and their models are written anew without them.

use super::leaving::{job_of, knows, models_of, slot_of};
use super::{
    audit, captures, checkpoints, consents, deletion, erasures, garbage, models, retraining,
    shares, subjects,
};
use crate::db::{Lock, Tx, sql};
use crate::{LeftModel, OpenErasure, SharedWeights, StoreError, Work};
use prost::Message;
use yoto_proto::names::Collection;
use yoto_proto::v1::{JobError, JobResult, JobSpec, job_result, job_spec};

/// Removes all rows of the person and notes their objects as deleted. Returns what was removed and what is to be removed from the
/// store, or `None` if an open job still needs the person.
pub(crate) async fn rows(tx: &mut Tx, erasure: &OpenErasure) -> Result<Option<Work>, StoreError> {
    let (tenant, id) = (&erasure.tenant, erasure.subject_id.as_str());
    let mut jobs = jobs_of(tx, erasure).await?;
    jobs.sort();
    let mut models = models_of(tx, id).await?;
    models.sort();
    for job in &jobs {
        tx.lock(Lock::Job(job)).await?;
    }
    for model in &models {
        tx.lock(Lock::Model(model)).await?;
    }
    tx.lock(Lock::Subject(id)).await?;
    let open = sql(
        "SELECT EXISTS (SELECT 1 FROM jobs j LEFT JOIN job_captures i ON i.job = j.id
             LEFT JOIN captures c ON c.id = j.capture LEFT JOIN erasure_models e ON e.job = j.id AND e.erasure = $2
             WHERE j.state IN ('QUEUED', 'RUNNING')
                 AND (i.subject = $1 OR c.subject = $1 OR e.erasure IS NOT NULL)) AS found",
    )
    .bind(id)
    .bind(&erasure.id)
    .one(tx, "looking for open jobs of a person")
    .await?;
    if open.flag("found")? {
        return Ok(None);
    }
    let subject = subjects::get(tx, tenant, id).await?;
    let mut work = Work {
        name: subject.display_name,
        ids: vec![id.to_owned()],
        ..Work::default()
    };
    // They would go unseen with their jobs.
    let links = shares::remove_of(tx, id).await?;
    work.count("links", links.len() as u64);
    work.ids.extend(links);
    for model in &models {
        let left = leave(tx, erasure, model, &mut work).await?;
        work.models.push(left);
    }
    for job in &jobs {
        remove_job(tx, erasure, job, &mut work).await?;
    }
    let mut of_person: Vec<String> = subject.captures;
    of_person.sort();
    for name in &of_person {
        let capture_id = name.strip_prefix("captures/").unwrap_or(name);
        tx.lock(Lock::Capture(capture_id)).await?;
        let capture = captures::get(tx, tenant, capture_id).await?;
        let deleted = deletion::remove_capture(tx, capture_id, &capture).await?;
        work.count("captures", 1);
        work.count("jobs", deleted.jobs.into());
        work.ids.push(capture_id.to_owned());
        work.folders.push(format!("captures/{capture_id}"));
        work.folders.push(format!("uploads/{capture_id}"));
    }
    work.ids.extend(consents::ids(tx, id).await?);
    forget_requests(tx, erasure, &mut work).await?;
    for (what, statement) in [
        ("slots", "DELETE FROM slots WHERE subject = $1"),
        ("consents", "DELETE FROM consents WHERE subject = $1"),
        ("people", "DELETE FROM subjects WHERE id = $1"),
    ] {
        let done = sql(statement).bind(id).execute(tx, "erasing rows").await?;
        work.count(what, done);
    }
    let forgotten = audit::forget(tx, &work.ids).await?;
    work.count("names in the audit log", forgotten);
    erasures::note_work(tx, &erasure.id, &work.to_json()?).await?;
    Ok(Some(work))
}

/// Jobs with a pin on the person, and those that took them out of models.
async fn jobs_of(tx: &mut Tx, erasure: &OpenErasure) -> Result<Vec<String>, StoreError> {
    let rows = sql("SELECT job FROM job_captures WHERE subject = $1
         UNION SELECT j.id FROM erasure_models e JOIN jobs j ON j.id = e.job WHERE e.erasure = $2")
    .bind(&erasure.subject_id)
    .bind(&erasure.id)
    .rows(tx, "listing jobs of a person")
    .await?;
    rows.iter().map(|row| row.text("job")).collect()
}

/// Removes the checkpoints of a model that still know the person: nobody else is in them, or they are damaged.
async fn leave(
    tx: &mut Tx,
    erasure: &OpenErasure,
    model_id: &str,
    work: &mut Work,
) -> Result<LeftModel, StoreError> {
    let tenant = &erasure.tenant;
    let model = models::get(tx, tenant, model_id).await?;
    let mut left = LeftModel {
        model: model.name.clone(),
        ..LeftModel::default()
    };
    let Some(slot) = slot_of(&model, &erasure.subject_id) else {
        return Ok(left);
    };
    left.slot = slot;
    let all = checkpoints::list(tx, tenant, model_id, u32::MAX).await?;
    for checkpoint in all.iter().filter(|it| knows(it, slot)) {
        // What was rewritten says that it does not know the person.
        checkpoints::remove(tx, model_id, checkpoint.step).await?;
        left.checkpoints_deleted += 1;
    }
    if let Some(job) = job_of(tx, tenant, &erasure.id, model_id).await? {
        let result = job.result.and_then(|it| it.kind);
        let removed = match result {
            Some(job_result::Kind::Train(train)) => train.removed,
            _ => Vec::new(),
        };
        left.note(&removed);
        // A job that was interrupted does not tell what it wrote before.
        let saw = removed.is_empty() || removed.iter().any(|it| it.trunk_saw_them);
        left.shared_weights = match saw {
            true => SharedWeights::SawThem,
            false => SharedWeights::NeverSawThem,
        };
        let retrained = retraining::made(tx, &erasure.id, model_id).await?;
        left.retrained = retrained.map(|id| Collection::Models.name(&id));
    } else if left.checkpoints_deleted > 0 {
        left.shared_weights = SharedWeights::Deleted;
    }
    work.count("checkpoints", left.checkpoints_deleted);
    work.unnamed.push(format!("models/{model_id}"));
    Ok(left)
}

/// Deletes a job that was about the person. A training of several people stays, without what it says about anybody.
async fn remove_job(
    tx: &mut Tx,
    erasure: &OpenErasure,
    job_id: &str,
    work: &mut Work,
) -> Result<(), StoreError> {
    let row = sql("SELECT kind, spec, result, error,
             (SELECT count(*) FROM job_captures i WHERE i.job = j.id AND i.subject <> $2) AS others
         FROM jobs j WHERE id = $1")
    .bind(job_id)
    .bind(&erasure.subject_id)
    .row(tx, "reading a job of a person")
    .await?;
    let Some(row) = row else {
        return Ok(());
    };
    let spec: JobSpec = row.message("spec")?.unwrap_or_default();
    let of_others = matches!(&spec.kind, Some(job_spec::Kind::Train(it)) if it.leave.is_empty())
        && row.number::<u64>("others")? > 0;
    if of_others {
        scrub(tx, job_id, row.message("result")?, row.message("error")?).await?;
        work.count("jobs_scrubbed", 1);
        return Ok(());
    }
    if matches!(&*row.text("kind")?, "render" | "export") {
        garbage::deleted(tx, &format!("renders/{job_id}")).await?;
        work.folders.push(format!("renders/{job_id}"));
    }
    work.jobs.push(job_id.to_owned());
    let deleted = sql("DELETE FROM jobs WHERE id = $1")
        .bind(job_id)
        .execute(tx, "erasing a job")
        .await?;
    work.count("jobs", deleted);
    Ok(())
}

/// Removes the texts of a training, which may name people: its notes, its error and those of its attempts.
async fn scrub(
    tx: &mut Tx,
    job_id: &str,
    result: Option<JobResult>,
    error: Option<JobError>,
) -> Result<(), StoreError> {
    let result = result.map(|mut result| {
        if let Some(job_result::Kind::Train(train)) = &mut result.kind {
            train.notes.clear();
        }
        result.encode_to_vec()
    });
    let error = error.map(|error| {
        let without = JobError {
            code: error.code,
            message: "removed with a person whom it may have named".to_owned(),
            violations: Vec::new(),
        };
        without.encode_to_vec()
    });
    sql("UPDATE jobs SET result = $2, error = $3, waiting_error = NULL, sequence = sequence + 1 WHERE id = $1")
        .bind(job_id)
        .bind(result)
        .bind(error)
        .execute(tx, "removing the texts of a job")
        .await?;
    sql("UPDATE job_attempts SET error = NULL WHERE job = $1")
        .bind(job_id)
        .execute(tx, "removing the texts of attempts")
        .await?;
    Ok(())
}

/// Forgets request ids that name the person, or whose answers name something of theirs.
async fn forget_requests(
    tx: &mut Tx,
    erasure: &OpenErasure,
    work: &mut Work,
) -> Result<(), StoreError> {
    let needles = work.ids.iter().chain(&work.jobs).chain([&work.name]);
    let mut gone = 0;
    for needle in needles {
        gone += sql("DELETE FROM request_ids WHERE tenant = $1
             AND (replace(request_id, $2, '') <> request_id OR replace(answer, $2, '') <> answer)")
        .bind(erasure.tenant.id())
        .bind(needle)
        .execute(tx, "forgetting request ids")
        .await?;
    }
    work.count("request_ids", gone);
    Ok(())
}
