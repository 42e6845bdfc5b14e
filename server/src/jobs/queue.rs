//! Queues and cancels jobs.
//!
//! A job that the catalogue can't serve is refused now instead of failing later. The checked
//! entries (shards, checkpoints, and slots while a job of their model waits) are never removed, so
//! the checks still hold when the job is leased.

use super::best::best_first;
use super::spec;
use crate::{
    context::Context,
    error::RequestError,
    store::{JobKind, RequestKey, StoreError},
};
use yoto_proto::{
    names::Collection,
    v1::{
        Checkpoint, EvaluateSpec, Job, JobSpec, Model, RenderSpec, TrainSpec, job_spec,
        render_spec::What,
    },
};

/// Checks a job and queues it.
///
/// # Errors
/// When the spec is malformed, names a missing resource, or can't be served yet.
pub async fn create(
    context: &Context,
    spec: JobSpec,
    request: Option<RequestKey>,
) -> Result<Job, RequestError> {
    spec::check_size(&spec)?;
    match &spec.kind {
        Some(job_spec::Kind::Train(train)) => check_train(context, train).await?,
        Some(job_spec::Kind::Render(render)) => check_render(context, render).await?,
        Some(job_spec::Kind::Evaluate(evaluate)) => check_evaluate(context, evaluate).await?,
        Some(job_spec::Kind::Ingest(_)) => {
            let message = "ingest jobs are started by uploading a capture";
            return Err(RequestError::invalid("spec.ingest", message));
        }
        None => return Err(RequestError::invalid("spec", "has no kind of job")),
    }
    let kind = JobKind::of(&spec).map_or("", JobKind::as_str);
    let job = context.store.create_job(spec, request).await?;
    context.changes.announce();
    tracing::info!(job = job.name, kind, "job queued");
    Ok(job)
}

/// Cancels a job: a queued one at once, a running one through its worker.
///
/// # Errors
/// When the job does not exist.
pub async fn cancel(context: &Context, id: &str) -> Result<Job, RequestError> {
    let job = context.store.cancel_job(id).await?;
    context.changes.announce();
    tracing::info!(
        job = job.name,
        state = job.state().as_str_name(),
        "job cancel requested"
    );
    Ok(job)
}

async fn check_train(context: &Context, train: &TrainSpec) -> Result<(), RequestError> {
    spec::check_train(train)?;
    let model = model(context, "spec.train.model", &train.model).await?;
    if model.slots.is_empty() {
        let message = format!("{} has no identities; add a subject first", model.name);
        return Err(RequestError::precondition("NO_IDENTITIES", message));
    }
    for slot in &model.slots {
        require_shard(context, "spec.train.model", &slot.subject).await?;
    }
    Ok(())
}

async fn check_render(context: &Context, render: &RenderSpec) -> Result<(), RequestError> {
    spec::check_render(render)?;
    let model = model(context, "spec.render.model", &render.model).await?;
    require_shard(context, "spec.render.subject", &render.subject).await?;
    require_slot(&model, &render.subject)?;
    if let Some(What::Motion(motion)) = &render.what {
        require_shard(context, "spec.render.motion.driver", &motion.driver).await?;
    }
    let used = require_checkpoint(context, "spec.render", &model, &render.checkpoint).await?;
    if render.quality.is_some() && used.tradeoff.is_none() {
        let message = format!(
            "no trade-off was measured with {}, the checkpoint to render with; measure it first: yoto \
             tradeoff --model {} --checkpoint {} --out DIR",
            used.name, model.display_name, used.step
        );
        return Err(RequestError::precondition("NO_TRADEOFF", message));
    }
    Ok(())
}

async fn check_evaluate(context: &Context, evaluate: &EvaluateSpec) -> Result<(), RequestError> {
    spec::check_evaluate(evaluate)?;
    let model = model(context, "spec.evaluate.model", &evaluate.model).await?;
    for (i, subject) in evaluate.subjects.iter().enumerate() {
        require_shard(context, &format!("spec.evaluate.subjects[{i}]"), subject).await?;
        require_slot(&model, subject)?;
    }
    for slot in &model.slots {
        if evaluate.subjects.is_empty() {
            require_shard(context, "spec.evaluate.model", &slot.subject).await?;
        }
    }
    require_checkpoint(context, "spec.evaluate", &model, &evaluate.checkpoint).await?;
    Ok(())
}

fn require_slot(model: &Model, subject: &str) -> Result<(), RequestError> {
    if model.slots.iter().any(|slot| slot.subject == subject) {
        return Ok(());
    }
    let message = format!("{subject} has no slot in {}", model.name);
    Err(RequestError::precondition("NO_SLOT", message))
}

/// The model's checkpoint called `wanted`, or its best one, for the specification at `field`.
async fn require_checkpoint(
    context: &Context,
    field: &str,
    model: &Model,
    wanted: &str,
) -> Result<Checkpoint, RequestError> {
    let id = parse(Collection::Models, &format!("{field}.model"), &model.name)?;
    let all = context.store.checkpoints(id, u32::MAX).await?;
    if !wanted.is_empty() {
        let found = all.into_iter().find(|it| it.name == wanted);
        return found.ok_or_else(|| {
            let shown: String = wanted.chars().take(200).collect();
            let message = format!("{} has no checkpoint '{shown}'", model.name);
            RequestError::invalid(format!("{field}.checkpoint"), message)
        });
    }
    best_first(all).into_iter().next().ok_or_else(|| {
        let message = format!("{} has no checkpoint; train it first", model.name);
        RequestError::precondition("NO_CHECKPOINT", message)
    })
}

async fn model(context: &Context, field: &str, name: &str) -> Result<Model, RequestError> {
    Ok(context
        .store
        .model(parse(Collection::Models, field, name)?)
        .await?)
}

/// Checks that the subject exists and has a shard.
async fn require_shard(context: &Context, field: &str, name: &str) -> Result<(), RequestError> {
    let id = parse(Collection::Subjects, field, name)?;
    if context.store.shard(id).await?.is_some() {
        return Ok(());
    }
    let state = context.store.subject(id).await?.state().as_str_name();
    Err(StoreError::Rule {
        reason: "SUBJECT_NOT_READY",
        message: format!("{name} is {state}; it needs a capture that is READY"),
    }
    .into())
}

fn parse<'a>(collection: Collection, field: &str, name: &'a str) -> Result<&'a str, RequestError> {
    collection
        .parse(name)
        .map_err(|error| RequestError::invalid(field, error.to_string()))
}
