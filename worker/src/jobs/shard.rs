//! Fetches the training shards of earlier ingest jobs.

use super::checkpoint::Downloaded;
use super::{JobContext, JobFailure};
use std::sync::Arc;
use yoto_avatar::train::refined_track;
use yoto_capture::Shard;
use yoto_proto::names;
use yoto_proto::v1::{Checkpoint, Model};
use yoto_proto::worker::v1::{Inputs, SubjectShard};

/// The shard of `subject`, with its display name.
pub(crate) fn fetch(
    context: &JobContext,
    inputs: &Inputs,
    subject: &str,
) -> Result<(String, Arc<Shard>), JobFailure> {
    let SubjectShard {
        display_name,
        shard,
        ..
    } = inputs
        .shards
        .iter()
        .find(|entry| entry.subject == subject)
        .ok_or_else(|| missing(subject))?;
    let object = shard.as_ref().ok_or_else(|| missing(subject))?;
    let bytes = context.get(object)??;
    let shard = Shard::from_bytes(Vec::from(bytes)).map_err(|error| {
        JobFailure::failed(
            "INTERNAL",
            &format!("the shard of {subject}, {}", object.key),
            &error,
        )
    })?;
    Ok((display_name.clone(), Arc::new(shard)))
}

/// The shard of `subject` with the poses that the training of the checkpoint `found` refined, if
/// it refined theirs, so that a render shows what the model was taught.
pub(crate) fn with_refined_poses(
    context: &JobContext,
    inputs: &Inputs,
    found: &Downloaded,
    subject: &str,
) -> Result<(String, Arc<Shard>), JobFailure> {
    let (name, mut shard) = fetch(context, inputs, subject)?;
    let slots = trained(inputs, &found.checkpoint).map_or(&[][..], |model| &model.slots);
    let Some(slot) = slots.iter().find(|it| it.subject == subject) else {
        return Ok((name, shard));
    };
    let refined = refined_track(found.folder.path(), slot.slot as usize, &shard.track)
        .map_err(|error| JobFailure::failed("INTERNAL", "the refined poses", &error))?;
    if let Some(refined) = refined {
        Arc::make_mut(&mut shard).track = refined;
    }
    Ok((name, shard))
}

/// The model that `checkpoint` belongs to.
fn trained<'a>(inputs: &'a Inputs, checkpoint: &Checkpoint) -> Option<&'a Model> {
    let others = inputs.other_models.iter();
    let others = others.filter_map(|other| other.model.as_ref());
    let is_of = |model: &&Model| {
        let name = names::checkpoint(&model.name, checkpoint.step);
        name == checkpoint.name
    };
    others.chain(&inputs.model).find(is_of)
}

/// Display name of `subject`, or its resource name where the inputs lack it.
pub(crate) fn person<'a>(inputs: &'a Inputs, subject: &'a str) -> &'a str {
    let shard = inputs.shards.iter().find(|it| it.subject == subject);
    shard.map_or(subject, |it| &it.display_name)
}

/// Display name of the model.
pub(crate) fn model(inputs: &Inputs) -> &str {
    inputs
        .model
        .as_ref()
        .map_or("the model", |it| &it.display_name)
}

fn missing(subject: &str) -> JobFailure {
    JobFailure::Failed {
        code: "NO_CAPTURE",
        message: format!("{subject} has no ingested capture"),
    }
}
