//! Checks whether the catalogue can serve an order.

use super::catalogue::{
    check_known, check_needs, model, require_checkpoint, require_shard, require_slot,
};
use super::parse;
use crate::context::Context;
use yoto_proto::checks::render::too_many;
use yoto_proto::names::Collection;
use yoto_proto::render_needs::{Need, needs, other_models};
use yoto_proto::v1::render_spec::What;
use yoto_proto::v1::{
    Checkpoint, ErrorReason, EvaluateSpec, ExportSpec, JobSpec, Model, MotionTransfer, RenderSpec,
    TrainSpec, job_spec,
};
use yoto_proto::worker::v1::SubjectShard;
use yoto_proto::{checks, exports, tiers};
use yoto_request::RequestError;
use yoto_request::validation::{all, both};
use yoto_store::Tenant;

/// Fewest frames of a person to train on: one pose can't tell how a body moves.
const MIN_TRAIN_FRAMES: u32 = 2;

/// Checks that the catalogue holds all that the order needs.
///
/// # Errors
/// When the order names a missing resource, or can't be served yet.
pub(crate) async fn check_spec(
    context: &Context,
    tenant: &Tenant,
    spec: &JobSpec,
) -> Result<(), RequestError> {
    match &spec.kind {
        Some(job_spec::Kind::Train(train)) => check_train(context, tenant, train).await,
        Some(job_spec::Kind::Render(render)) => check_render(context, tenant, render).await,
        Some(job_spec::Kind::Evaluate(evaluate)) => check_evaluate(context, tenant, evaluate).await,
        Some(job_spec::Kind::Export(export)) => check_export(context, tenant, export).await,
        Some(job_spec::Kind::Ingest(_)) => {
            let message = "ingest jobs are started by uploading a capture";
            Err(RequestError::invalid("spec.ingest", message))
        }
        None => Ok(()),
    }
}

async fn check_train(
    context: &Context,
    tenant: &Tenant,
    train: &TrainSpec,
) -> Result<(), RequestError> {
    if !train.leave.is_empty() {
        let message = "a person is taken out of models by EraseSubject";
        return Err(RequestError::invalid("spec.train.leave", message));
    }
    context.ensure_room(0)?;
    let model = model(context, tenant, "spec.train.model", &train.model).await?;
    let of_tier = checks::train::of_tier(train, &model.tier).into_iter();
    let of_tier = all::<()>(of_tier.map(|fault| {
        let field = format!("spec.train.{}", fault.field);
        Err(RequestError::invalid(field, fault.message))
    }));
    let people = check_people(context, tenant, train, &model).await;
    both(of_tier, people).map(drop)
}

/// Checks that the people to train on have captures.
async fn check_people(
    context: &Context,
    tenant: &Tenant,
    train: &TrainSpec,
    model: &Model,
) -> Result<(), RequestError> {
    if model.slots.is_empty() {
        let message = format!("{} has no people; add one first", model.display_name);
        return Err(RequestError::precondition(
            ErrorReason::NoIdentities,
            message,
        ));
    }
    let people: Vec<&str> = match &*train.only {
        "" => model.slots.iter().map(|slot| &*slot.subject).collect(),
        only => vec![check_only(context, tenant, model, only).await?],
    };
    let mut found = Vec::with_capacity(people.len());
    for subject in people {
        found.push(check_frames(context, tenant, subject).await);
    }
    all(found).map(drop)
}

/// Checks that a person can be trained on.
async fn check_frames(
    context: &Context,
    tenant: &Tenant,
    subject: &str,
) -> Result<(), RequestError> {
    let shard = require_shard(context, tenant, "spec.train.model", subject).await?;
    if shard.frames >= MIN_TRAIN_FRAMES {
        return Ok(());
    }
    let message = format!(
        "the capture of {} has {} frame: a training sees a person in at least {MIN_TRAIN_FRAMES} frames, of \
         different poses",
        shard.display_name, shard.frames
    );
    Err(RequestError::precondition(
        ErrorReason::TooFewFrames,
        message,
    ))
}

/// Checks that one person can be trained alone: the shared weights of the model must be trained before.
async fn check_only<'a>(
    context: &Context,
    tenant: &Tenant,
    model: &Model,
    only: &'a str,
) -> Result<&'a str, RequestError> {
    require_slot(context, tenant, model, only).await?;
    let id = parse(Collection::Models, "spec.train.model", &model.name)?;
    if context.store.checkpoints(tenant, id, 1).await?.is_empty() {
        let message = format!(
            "{} is untrained, so no person can be trained in it alone: train it first",
            model.display_name
        );
        return Err(RequestError::precondition(
            ErrorReason::NoCheckpoint,
            message,
        ));
    }
    Ok(only)
}

async fn check_render(
    context: &Context,
    tenant: &Tenant,
    render: &RenderSpec,
) -> Result<(), RequestError> {
    let own = model(context, tenant, "spec.render.model", &render.model).await?;
    let used = check_shown(context, tenant, render, &own, "").await;
    let mut found = vec![
        used.and_then(|used| check_tradeoff(render, &own, &used)),
        check_pictures(context, tenant, render).await,
    ];
    for (field, name) in other_models(render) {
        found.push(check_other(context, tenant, render, &field, name).await);
    }
    all(found).map(drop)
}

/// Checks that the trade-off of the checkpoint to use was measured, if the render needs it.
fn check_tradeoff(
    render: &RenderSpec,
    model: &Model,
    used: &Checkpoint,
) -> Result<(), RequestError> {
    let measured = render.quality.as_ref().is_some_and(tiers::needs_tradeoff);
    if !measured || used.tradeoff.is_some() {
        return Ok(());
    }
    let message = format!(
        "no trade-off was measured with {}, the checkpoint to render with; measure it first: yoto tradeoff {} \
         --checkpoint {} --out DIR",
        used.name, model.display_name, used.step
    );
    Err(RequestError::precondition(ErrorReason::NoTradeoff, message))
}

/// Checks the model `name` that the `field` of a scene names beside that of the render.
async fn check_other(
    context: &Context,
    tenant: &Tenant,
    render: &RenderSpec,
    field: &str,
    name: &str,
) -> Result<(), RequestError> {
    let path = format!("spec.render.{field}");
    let id = parse(Collection::Models, &path, name)?;
    let other = context.store.model(tenant, id).await?;
    check_shown(context, tenant, render, &other, field)
        .await
        .map(drop)
}

/// Checks the number of pictures of a capture's motion, unless the capture has gaps: then only the worker knows it.
async fn check_pictures(
    context: &Context,
    tenant: &Tenant,
    render: &RenderSpec,
) -> Result<(), RequestError> {
    let Some(What::Motion(motion)) = &render.what else {
        return Ok(());
    };
    let field = "spec.render.motion.frame_count";
    let shard = require_shard(context, tenant, "spec.render.motion.driver", &motion.driver).await?;
    let people = render.between.as_ref().map_or(1, |it| it.shares.len());
    let refusal = motion_pictures(&shard, motion).and_then(|it| too_many(it, people as u64));
    match refusal {
        Some(message) => Err(RequestError::invalid(field, message)),
        None => Ok(()),
    }
}

/// The pictures of a motion of the capture of `shard`; `None` if its frames have gaps.
fn motion_pictures(shard: &SubjectShard, motion: &MotionTransfer) -> Option<u64> {
    let first = u64::from(shard.first_frame?);
    let end = u64::from(shard.last_frame?) + 1;
    if end.checked_sub(first)? != u64::from(shard.frames) {
        return None;
    }
    let from = motion.first_frame.map_or(first, u64::from);
    let until = motion.end_frame.map_or(end, |it| end.min(it.into()));
    let frames = until.saturating_sub(from);
    let all = frames.div_ceil(u64::from(motion.frame_step.max(1)));
    Some(match motion.frame_count {
        0 => all,
        most => all.min(most.into()),
    })
}

/// Checks that a render can use one of its models: its own, or the one that the field `actor` of its scene
/// names. Returns the checkpoint to use.
async fn check_shown(
    context: &Context,
    tenant: &Tenant,
    render: &RenderSpec,
    model: &Model,
    actor: &str,
) -> Result<Checkpoint, RequestError> {
    let needs = needs(render).into_iter();
    let needs: Vec<Need<'_>> = needs.filter(|it| it.model == model.name).collect();
    let shown = check_needs(context, tenant, "spec.render", model, &needs).await;
    let wanted = if actor.is_empty() {
        &*render.checkpoint
    } else {
        ""
    };
    let used = require_checkpoint(context, tenant, "spec.render", model, wanted).await;
    let used = used.map_err(|error| error.of(actor));
    let refusal = (render.quality.as_ref()).and_then(|it| tiers::refusal(it, &model.tier));
    let quality = match refusal {
        Some(message) => {
            let message = format!("{}: {message}", model.display_name);
            Err(RequestError::invalid("spec.render.quality", message))
        }
        None => Ok(()),
    };
    let known = both(shown, used).and_then(|(shown, used)| {
        check_known(&used, model, &shown)?;
        Ok(used)
    });
    let (used, ()) = both(known, quality)?;
    Ok(used)
}

async fn check_export(
    context: &Context,
    tenant: &Tenant,
    export: &ExportSpec,
) -> Result<(), RequestError> {
    let model = model(context, tenant, "spec.export.model", &export.model).await?;
    let needs = exports::needs(export);
    let shown = check_needs(context, tenant, "spec.export", &model, &needs).await;
    let used = require_checkpoint(context, tenant, "spec.export", &model, &export.checkpoint).await;
    let known = both(shown, used).and_then(|(shown, used)| check_known(&used, &model, &shown));
    let form = match export.distillation.is_some() && model.tier == tiers::SPLATS {
        true => {
            let message = format!(
                "{} has the tier {}: there is nothing to distill",
                model.display_name, model.tier
            );
            Err(RequestError::invalid("spec.export.distillation", message))
        }
        false => Ok(()),
    };
    both(known, form).map(drop)
}

async fn check_evaluate(
    context: &Context,
    tenant: &Tenant,
    evaluate: &EvaluateSpec,
) -> Result<(), RequestError> {
    let model = model(context, tenant, "spec.evaluate.model", &evaluate.model).await?;
    let mut found = Vec::new();
    for (i, subject) in evaluate.subjects.iter().enumerate() {
        let field = format!("spec.evaluate.subjects[{i}]");
        let shard = require_shard(context, tenant, &field, subject).await;
        let slot = require_slot(context, tenant, &model, subject).await;
        found.push(both(shard, slot).map(drop));
    }
    for slot in &model.slots {
        if evaluate.subjects.is_empty() {
            let shard = require_shard(context, tenant, "spec.evaluate.model", &slot.subject).await;
            found.push(shard.map(drop));
        }
    }
    let checkpoint = &evaluate.checkpoint;
    let used = require_checkpoint(context, tenant, "spec.evaluate", &model, checkpoint).await;
    found.push(used.map(drop));
    all(found).map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pictures_of_a_motion_are_known_without_gaps() {
        let shard = |frames, last| SubjectShard {
            frames,
            first_frame: Some(10),
            last_frame: Some(last),
            ..SubjectShard::default()
        };
        let whole = shard(100, 109);
        let all = MotionTransfer {
            frame_step: 1,
            ..MotionTransfer::default()
        };
        assert_eq!(motion_pictures(&whole, &all), Some(100));
        assert_eq!(motion_pictures(&shard(99, 109), &all), None);
        let cases = [
            (Some(60), 0, 1, None, 50),
            (Some(60), 0, 3, None, 17),
            (Some(60), 7, 3, None, 7),
            (Some(60), 0, 1, Some(70), 10),
            (None, 0, 1, Some(9_000_000), 100),
            (None, 5, 0, Some(20), 5),
        ];
        for (first_frame, frame_count, frame_step, end_frame, expected) in cases {
            let motion = MotionTransfer {
                first_frame,
                frame_count,
                frame_step,
                end_frame,
                ..MotionTransfer::default()
            };
            assert_eq!(
                motion_pictures(&whole, &motion),
                Some(expected),
                "{motion:?}"
            );
        }
    }
}
