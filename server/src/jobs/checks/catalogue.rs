//! What the catalogue must hold for an order: captures, slots, checkpoints.

use super::parse;
use crate::context::Context;
use yoto_proto::names::{self, Collection};
use yoto_proto::render_needs::Need;
use yoto_proto::v1::{Checkpoint, ErrorReason, Model};
use yoto_proto::worker::v1::SubjectShard;
use yoto_request::RequestError;
use yoto_request::validation::{all, both};
use yoto_store::rules::best::best_first;
use yoto_store::{StoreError, Tenant};

/// A person who must have a slot in a model.
pub(super) struct RequiredSlot {
    pub slot: u32,
    /// Field of the order that names the person, e.g. `scene.actors[1].subject`.
    pub field: String,
    pub person: String,
}

/// Checks that each needed person has a capture with the requested frame. Returns the people who must have a
/// slot in the model. `field` is the path of the specification.
pub(super) async fn check_needs(
    context: &Context,
    tenant: &Tenant,
    field: &str,
    model: &Model,
    needs: &[Need<'_>],
) -> Result<Vec<RequiredSlot>, RequestError> {
    let mut shown = Vec::with_capacity(needs.len());
    for need in needs {
        shown.push(check_need(context, tenant, field, model, need).await);
    }
    Ok(all(shown)?.into_iter().flatten().collect())
}

/// Checks one need. Returns the slot that it requires.
async fn check_need(
    context: &Context,
    tenant: &Tenant,
    field: &str,
    model: &Model,
    need: &Need<'_>,
) -> Result<Option<RequiredSlot>, RequestError> {
    let field = |name: &str| format!("{field}.{name}");
    let shard = require_shard(context, tenant, &field(&need.field), need.subject).await?;
    let frame = match &need.frame {
        Some((name, frame)) => check_frame(&shard, &field(name), *frame),
        None => Ok(()),
    };
    let slot = match need.slot {
        true => {
            let slot = require_slot(context, tenant, model, need.subject).await;
            slot.map(Some).map_err(|error| error.of(&need.field))
        }
        false => Ok(None),
    };
    let (slot, ()) = both(slot, frame)?;
    Ok(slot.map(|slot| RequiredSlot {
        slot,
        field: need.field.clone(),
        person: shard.display_name.clone(),
    }))
}

/// Checks that the checkpoint was trained with all required slots.
pub(super) fn check_known(
    used: &Checkpoint,
    model: &Model,
    shown: &[RequiredSlot],
) -> Result<(), RequestError> {
    // Checkpoints of earlier versions don't tell their slots.
    let unknown = |it: &&RequiredSlot| !used.slots.is_empty() && !used.slots.contains(&it.slot);
    let unknown = shown.iter().filter(unknown);
    all::<()>(unknown.map(|RequiredSlot { field, person, .. }| {
        let message = format!(
            "step {} of {} was trained before {person} joined the model: train it again",
            used.step, model.display_name
        );
        Err(RequestError::precondition(ErrorReason::NotTrained, message).of(field))
    }))
    .map(drop)
}

/// The subject's slot in the model. Fails if the subject does not exist or has no slot.
pub(super) async fn require_slot(
    context: &Context,
    tenant: &Tenant,
    model: &Model,
    subject: &str,
) -> Result<u32, RequestError> {
    if let Some(slot) = model.slots.iter().find(|slot| slot.subject == subject) {
        return Ok(slot.slot);
    }
    let id = parse(Collection::Subjects, "subject", subject)?;
    let person = context.store.subject(tenant, id).await?.display_name;
    let message = format!("{person} is not in {}", model.display_name);
    Err(RequestError::precondition(ErrorReason::NoSlot, message))
}

/// The model's checkpoint with the name `wanted`, or its best one if that is empty.
pub(super) async fn require_checkpoint(
    context: &Context,
    tenant: &Tenant,
    field: &str,
    model: &Model,
    wanted: &str,
) -> Result<Checkpoint, RequestError> {
    let id = parse(Collection::Models, &format!("{field}.model"), &model.name)?;
    let all = context.store.checkpoints(tenant, id, u32::MAX).await?;
    if !wanted.is_empty() {
        let found = all.into_iter().find(|it| it.name == wanted);
        return found.ok_or_else(|| match names::parse_checkpoint(wanted) {
            Ok(_) => RequestError::NotFound {
                name: wanted.to_owned(),
            },
            Err(error) => RequestError::invalid(format!("{field}.checkpoint"), error.to_string()),
        });
    }
    best_first(all).into_iter().next().ok_or_else(|| {
        let message = format!("{} has no checkpoint; train it first", model.display_name);
        RequestError::precondition(ErrorReason::NoCheckpoint, message)
    })
}

pub(super) async fn model(
    context: &Context,
    tenant: &Tenant,
    field: &str,
    name: &str,
) -> Result<Model, RequestError> {
    Ok(context
        .store
        .model(tenant, parse(Collection::Models, field, name)?)
        .await?)
}

/// Checks that the `wanted` frame lies between the first and the last frame of the capture, where these are
/// known. A frame between them may still be missing: the worker finds that out.
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

/// The shard of the subject. Fails if the subject does not exist or has no shard.
pub(super) async fn require_shard(
    context: &Context,
    tenant: &Tenant,
    field: &str,
    name: &str,
) -> Result<SubjectShard, RequestError> {
    let id = parse(Collection::Subjects, field, name)?;
    if let Some(shard) = context.store.shard(tenant, id).await? {
        return Ok(shard);
    }
    let subject = context.store.subject(tenant, id).await?;
    let (person, state) = (&subject.display_name, subject.state().as_str_name());
    Err(StoreError::Rule {
        reason: ErrorReason::SubjectNotReady,
        message: format!("{person} is {state}: a capture that is READY is needed"),
    }
    .into())
}
