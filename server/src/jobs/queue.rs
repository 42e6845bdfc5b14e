//! Queues and cancels jobs.
//!
//! A job that the catalogue can't serve is refused now instead of failing later. The checked
//! entries (shards, the checkpoint to use, slots) are not removed while a job that uses them waits or
//! runs, so the checks still hold when the job is leased.

use crate::checkpoints::best::best_first;
use crate::context::Context;
use crate::error::RequestError;
use crate::store::{JobKind, NewJob, RequestKey, StoreError};
use yoto_proto::names::Collection;
use yoto_proto::render_needs::{Need, needs, other_models};
use yoto_proto::v1::{
    Checkpoint, EvaluateSpec, ExportSpec, Job, Model, RenderSpec, SubjectShard, TrainSpec, job_spec,
};
use yoto_proto::{checks, exports, tiers};

/// Fewest frames of a person to train on: one pose can't tell how a body moves.
const MIN_TRAIN_FRAMES: u32 = 2;

/// Checks a job and queues it.
///
/// # Errors
/// When the spec is malformed, names a missing resource, or can't be served yet.
pub async fn create(
    context: &Context,
    new: NewJob,
    request: Option<RequestKey>,
) -> Result<Job, RequestError> {
    // Before every check: what was accepted once is accepted again, whatever has changed since.
    if let Some(id) = context.store.answered(request.as_ref()).await? {
        return Ok(context.store.job(&id).await?);
    }
    if let Some(fault) = checks::job(&new.spec).into_iter().next() {
        return Err(RequestError::invalid(path(&fault.field), fault.message));
    }
    match &new.spec.kind {
        Some(job_spec::Kind::Train(train)) => check_train(context, train).await?,
        Some(job_spec::Kind::Render(render)) => check_render(context, render).await?,
        Some(job_spec::Kind::Evaluate(evaluate)) => check_evaluate(context, evaluate).await?,
        Some(job_spec::Kind::Export(export)) => check_export(context, export).await?,
        Some(job_spec::Kind::Ingest(_)) => {
            let message = "ingest jobs are started by uploading a capture";
            return Err(RequestError::invalid("spec.ingest", message));
        }
        None => {}
    }
    let kind = JobKind::of(&new.spec).map_or("", JobKind::as_str);
    let job = context.store.create_job(new, request).await?;
    tracing::info!(job = job.name, kind, "job queued");
    Ok(job)
}

/// The path in a request of the order's `field`.
fn path(field: &str) -> String {
    match field {
        "" => "spec".into(),
        field => format!("spec.{field}"),
    }
}

/// Cancels a job: a queued one at once, a running one through its worker.
///
/// # Errors
/// When the job does not exist.
pub async fn cancel(
    context: &Context,
    id: &str,
    request: Option<RequestKey>,
) -> Result<Job, RequestError> {
    let job = context.store.cancel_job(id, request).await?;
    context.changes.announce(&job.name);
    tracing::info!(
        job = job.name,
        state = job.state().as_str_name(),
        "job cancel requested"
    );
    Ok(job)
}

async fn check_train(context: &Context, train: &TrainSpec) -> Result<(), RequestError> {
    context.ensure_room(0)?;
    let model = model(context, "spec.train.model", &train.model).await?;
    if let Some(fault) = checks::train::of_tier(train, &model.tier)
        .into_iter()
        .next()
    {
        let field = format!("spec.train.{}", fault.field);
        return Err(RequestError::invalid(field, fault.message));
    }
    if model.slots.is_empty() {
        let message = format!("{} has no people; add one first", model.display_name);
        return Err(RequestError::precondition("NO_IDENTITIES", message));
    }
    let people: Vec<&str> = match &*train.only {
        "" => model.slots.iter().map(|slot| &*slot.subject).collect(),
        only => vec![check_only(context, &model, only).await?],
    };
    for subject in people {
        let shard = require_shard(context, "spec.train.model", subject).await?;
        if shard.frames < MIN_TRAIN_FRAMES {
            let message = format!(
                "the capture of {} has {} frame: a training sees a person in at least \
                 {MIN_TRAIN_FRAMES} frames, of different poses",
                shard.display_name, shard.frames
            );
            return Err(RequestError::precondition("TOO_FEW_FRAMES", message));
        }
    }
    Ok(())
}

/// Somebody is trained alone in a model whose trunk is trained.
async fn check_only<'a>(
    context: &Context,
    model: &Model,
    only: &'a str,
) -> Result<&'a str, RequestError> {
    require_slot(context, model, only).await?;
    let id = parse(Collection::Models, "spec.train.model", &model.name)?;
    if context.store.checkpoints(id, 1).await?.is_empty() {
        let message = format!(
            "{} is untrained, and nobody can join it before others have trained it: train it first",
            model.display_name
        );
        return Err(RequestError::precondition("NO_CHECKPOINT", message));
    }
    Ok(only)
}

async fn check_render(context: &Context, render: &RenderSpec) -> Result<(), RequestError> {
    let own = model(context, "spec.render.model", &render.model).await?;
    let used = check_shown(context, render, &own, "").await?;
    for (field, name) in other_models(render) {
        let path = format!("spec.render.{field}");
        let id = parse(Collection::Models, &path, name)?;
        let other = context.store.model(id).await.map_err(|error| match error {
            StoreError::NotFound { .. } => RequestError::invalid(path, error.to_string()),
            error => error.into(),
        })?;
        check_shown(context, render, &other, &field).await?;
    }
    let measured = render.quality.as_ref().is_some_and(tiers::needs_tradeoff);
    if measured && used.tradeoff.is_none() {
        let message = format!(
            "no trade-off was measured with {}, the checkpoint to render with; measure it first: yoto \
             tradeoff {} --checkpoint {} --out DIR",
            used.name, own.display_name, used.step
        );
        return Err(RequestError::precondition("NO_TRADEOFF", message));
    }
    Ok(())
}

/// Checks what a render needs of one of its models: its own, or one that the field `actor` of its scene names.
/// Returns the checkpoint that it uses.
async fn check_shown(
    context: &Context,
    render: &RenderSpec,
    model: &Model,
    actor: &str,
) -> Result<Checkpoint, RequestError> {
    let needs = needs(render).into_iter();
    let needs: Vec<Need<'_>> = needs.filter(|it| it.model == model.name).collect();
    let shown = check_needs(context, "spec.render", model, &needs).await?;
    let wanted = if actor.is_empty() {
        &*render.checkpoint
    } else {
        ""
    };
    let used = require_checkpoint(context, "spec.render", model, wanted).await;
    let used = used.map_err(|error| error.of(actor))?;
    check_known(&used, model, &shown)?;
    let refusal = (render.quality.as_ref()).and_then(|it| tiers::refusal(it, &model.tier));
    match refusal {
        Some(message) => {
            let message = format!("{}: {message}", model.display_name);
            Err(RequestError::invalid("spec.render.quality", message))
        }
        None => Ok(used),
    }
}

async fn check_export(context: &Context, export: &ExportSpec) -> Result<(), RequestError> {
    let model = model(context, "spec.export.model", &export.model).await?;
    let needs = exports::needs(export);
    let shown = check_needs(context, "spec.export", &model, &needs).await?;
    let used = require_checkpoint(context, "spec.export", &model, &export.checkpoint).await?;
    check_known(&used, &model, &shown)?;
    if export.distillation.is_some() && model.tier == tiers::SPLATS {
        let message = format!(
            "{} has the tier {}: there is nothing to distill",
            model.display_name, model.tier
        );
        return Err(RequestError::invalid("spec.export.distillation", message));
    }
    Ok(())
}

/// Somebody who has a slot in a model.
struct Shown {
    slot: u32,
    /// Who asks for them, e.g. `scene.actors[1].subject`.
    field: String,
    person: String,
}

/// Checks that everybody whom the specification at `field` needs has a capture, with the requested frame. Returns those who
/// must have a slot in the model.
async fn check_needs(
    context: &Context,
    field: &str,
    model: &Model,
    needs: &[Need<'_>],
) -> Result<Vec<Shown>, RequestError> {
    let mut shown = Vec::new();
    for need in needs {
        let field = |name: &str| format!("{field}.{name}");
        let shard = require_shard(context, &field(&need.field), need.subject).await?;
        if need.slot {
            let slot = require_slot(context, model, need.subject).await;
            shown.push(Shown {
                slot: slot.map_err(|error| error.of(&need.field))?,
                field: need.field.clone(),
                person: shard.display_name.clone(),
            });
        }
        if let Some((name, frame)) = &need.frame {
            check_frame(&shard, &field(name), *frame)?;
        }
    }
    Ok(shown)
}

/// The checkpoint `used` knows everybody who is `shown`.
fn check_known(used: &Checkpoint, model: &Model, shown: &[Shown]) -> Result<(), RequestError> {
    let unknown = shown.iter().find(|it| !used.slots.contains(&it.slot));
    if let Some(Shown { field, person, .. }) = unknown
        && !used.slots.is_empty()
    {
        let message = format!(
            "step {} of {} was trained before {person} joined the model: train it again",
            used.step, model.display_name
        );
        return Err(RequestError::precondition("NOT_TRAINED", message).of(field));
    }
    Ok(())
}

async fn check_evaluate(context: &Context, evaluate: &EvaluateSpec) -> Result<(), RequestError> {
    let model = model(context, "spec.evaluate.model", &evaluate.model).await?;
    for (i, subject) in evaluate.subjects.iter().enumerate() {
        require_shard(context, &format!("spec.evaluate.subjects[{i}]"), subject).await?;
        require_slot(context, &model, subject).await?;
    }
    for slot in &model.slots {
        if evaluate.subjects.is_empty() {
            require_shard(context, "spec.evaluate.model", &slot.subject).await?;
        }
    }
    require_checkpoint(context, "spec.evaluate", &model, &evaluate.checkpoint).await?;
    Ok(())
}

/// The subject's slot in the model; the subject exists.
async fn require_slot(
    context: &Context,
    model: &Model,
    subject: &str,
) -> Result<u32, RequestError> {
    if let Some(slot) = model.slots.iter().find(|slot| slot.subject == subject) {
        return Ok(slot.slot);
    }
    let id = parse(Collection::Subjects, "subject", subject)?;
    let person = context.store.subject(id).await?.display_name;
    let message = format!("{person} is not in {}", model.display_name);
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
            let message = format!("{} has no checkpoint '{shown}'", model.display_name);
            RequestError::invalid(format!("{field}.checkpoint"), message)
        });
    }
    best_first(all).into_iter().next().ok_or_else(|| {
        let message = format!("{} has no checkpoint; train it first", model.display_name);
        RequestError::precondition("NO_CHECKPOINT", message)
    })
}

async fn model(context: &Context, field: &str, name: &str) -> Result<Model, RequestError> {
    Ok(context
        .store
        .model(parse(Collection::Models, field, name)?)
        .await?)
}

/// Checks that the `wanted` frame is not beyond the frames of a capture, where they are known. It may
/// still lack a frame between them: the worker tells.
fn check_frame(shard: &SubjectShard, field: &str, wanted: u32) -> Result<(), RequestError> {
    let (Some(first), Some(last)) = (shard.first_frame, shard.last_frame) else {
        return Ok(());
    };
    if (first..=last).contains(&wanted) {
        return Ok(());
    }
    let person = &shard.display_name;
    let message = format!("{person}'s capture has frames {first} to {last}, not {wanted}");
    Err(RequestError::invalid(field, message))
}

/// The shard of the subject, which must exist and have one.
async fn require_shard(
    context: &Context,
    field: &str,
    name: &str,
) -> Result<SubjectShard, RequestError> {
    let id = parse(Collection::Subjects, field, name)?;
    if let Some(shard) = context.store.shard(id).await? {
        return Ok(shard);
    }
    let subject = context.store.subject(id).await?;
    let (person, state) = (&subject.display_name, subject.state().as_str_name());
    Err(StoreError::Rule {
        reason: "SUBJECT_NOT_READY",
        message: format!("{person} is {state}: a capture that is READY is needed"),
    }
    .into())
}

fn parse<'a>(collection: Collection, field: &str, name: &'a str) -> Result<&'a str, RequestError> {
    collection
        .parse(name)
        .map_err(|error| RequestError::invalid(field, error.to_string()))
}
