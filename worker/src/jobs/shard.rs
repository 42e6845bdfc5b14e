//! Fetches the training shards of earlier ingest jobs.

use super::checkpoint::Downloaded;
use super::{JobContext, JobFailure};
use std::sync::Arc;
use yoto_capture::Shard;
use yoto_proto::manifest::files;
use yoto_proto::pose_track::PoseTrack;
use yoto_proto::v1::{Inputs, SubjectShard};

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
    let slots = inputs.model.iter().flat_map(|model| &model.slots);
    let Some(slot) = slots.into_iter().find(|it| it.subject == subject) else {
        return Ok((name, shard));
    };
    let file = files::refined_poses(slot.slot as usize);
    let path = found.folder.path().join(&file);
    if !path.exists() {
        return Ok((name, shard));
    }
    let bytes = std::fs::read(path)
        .map_err(|error| JobFailure::failed("INTERNAL", "the worker's temporary folder", &error))?;
    let refined = PoseTrack::from_binary(&bytes).map_err(JobFailure::Invalid)?;
    // A person may have been filmed anew since.
    if same_film(&refined, &shard.track) {
        Arc::make_mut(&mut shard).track = refined;
    }
    Ok((name, shard))
}

/// Whether two tracks are of the same frames and cameras.
fn same_film(a: &PoseTrack, b: &PoseTrack) -> bool {
    a.skeleton == b.skeleton
        && a.image_size == b.image_size
        && a.frames.len() == b.frames.len()
        && (a.frames.iter().zip(&b.frames)).all(|(a, b)| (a.index, a.k, a.e) == (b.index, b.k, b.e))
}

fn missing(subject: &str) -> JobFailure {
    JobFailure::Failed {
        code: "NO_CAPTURE",
        message: format!("{subject} has no ingested capture"),
    }
}
