//! Takes a person out of the checkpoints of a model: each is written anew without what is theirs, and replaces the one of the
//! same step. Nothing is trained, and everybody else's part is the same bit for bit.

use crate::jobs::checkpoint::{Saved, first_whole, local, publish};
use crate::jobs::{JobContext, JobFailure};
use std::time::Instant;
use yoto_avatar::train::leaving::{Certificate, SharedWeights, remove_person};
use yoto_proto::manifest::files;
use yoto_proto::v1::{Checkpoint, RemovedPerson, TrainResult, TrainSpec};
use yoto_proto::worker::v1::Inputs;

/// Rewrites all checkpoints of the inputs, which are those that know the person. A damaged one is passed over: the service
/// deletes what still knows them at the end.
pub(super) fn run(
    context: &JobContext,
    spec: &TrainSpec,
    inputs: &Inputs,
) -> Result<TrainResult, JobFailure> {
    let model = inputs.model.clone().unwrap_or_default();
    let slot = model.slots.iter().find(|it| it.subject == spec.leave);
    let slot = slot.map(|it| it.slot).ok_or_else(|| {
        let message = format!("{} has no slot in {}", spec.leave, model.name);
        JobFailure::invalid("train", "leave", message)
    })?;
    let all = &inputs.checkpoints;
    let mut result = TrainResult::default();
    // The oldest first: if this is interrupted, the newest one is rewritten last, and a training can't begin meanwhile.
    for (done, checkpoint) in all.iter().rev().enumerate() {
        context.check()?;
        context.report_pieces("removing", done, all.len());
        if let Some(removed) = rewrite(context, &model.name, checkpoint, slot)? {
            result.checkpoint.clone_from(&checkpoint.name);
            result.removed.push(removed);
        }
    }
    Ok(result)
}

/// Rewrites one checkpoint; `None` if it is damaged.
fn rewrite(
    context: &JobContext,
    model: &str,
    checkpoint: &Checkpoint,
    slot: u32,
) -> Result<Option<RemovedPerson>, JobFailure> {
    let began = Instant::now();
    let wanted = [files::WEIGHTS, files::OPTIMISER, files::STATE];
    let Some(found) = first_whole(context, std::slice::from_ref(checkpoint), &wanted)? else {
        return Ok(None);
    };
    let folder = context.folder().map_err(|error| local(&error))?;
    let without = folder.path().join("without");
    let certificate = remove_person(found.folder.path(), &without, slot as usize)
        .map_err(|error| JobFailure::failed("LEAVING", "removing a person", &error))?;
    let at = checkpoint.slots.iter().position(|it| *it == slot);
    let mut shards = checkpoint.shards.clone();
    if let Some(at) = at.filter(|at| *at < shards.len()) {
        shards.remove(at);
    }
    let others = checkpoint.slots.iter().copied().filter(|it| *it != slot);
    let saved = Saved {
        began,
        model: model.to_owned(),
        step: checkpoint.step,
        job_seconds: found.manifest.job_seconds,
        job_steps: found.manifest.job_steps,
        psnr: checkpoint.psnr,
        slots: others.collect(),
        image_size: checkpoint.image_size,
        shards,
    };
    publish(context, &without, &saved)?;
    Ok(Some(told(&certificate)))
}

/// The certificate as the service keeps it.
fn told(certificate: &Certificate) -> RemovedPerson {
    let removed = &certificate.removed;
    RemovedPerson {
        step: certificate.step,
        trunk_saw_them: certificate.shared_weights == SharedWeights::SawThem,
        tensors: removed.tensors.len() as u32,
        moments: removed.moments as u32,
        files: removed.files.len() as u32,
        searched: certificate.searched as u32,
        weights_sha256: certificate.weights.clone(),
    }
}
