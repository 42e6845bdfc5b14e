//! Checkpoints between a local folder and the object store.
//!
//! Data objects first, then the manifest with their checksums, then the coordinator's row:
//! a checkpoint with a row is complete, and later damage is detected.

use super::context::id;
use super::{JobContext, JobFailure, shard};
use std::fs;
use std::path::Path;
use std::time::Instant;
use tempfile::TempDir;
use yoto_avatar::render::Renderer;
use yoto_proto::keys;
use yoto_proto::manifest::{self, Manifest, ManifestObject, files};
use yoto_proto::names::{self, Collection};
use yoto_proto::v1::{Checkpoint, ObjectRef};
use yoto_proto::worker::v1::Inputs;

/// A checkpoint's files on this machine.
pub(crate) struct Downloaded {
    /// Folder with the files under their names in [`files`].
    pub(crate) folder: TempDir,
    pub(crate) manifest: Manifest,
    /// The catalogue's entry.
    pub(crate) checkpoint: Checkpoint,
}

/// State of a training when it is saved.
#[derive(Debug, Clone)]
pub(crate) struct Saved {
    /// When the trainer began to save.
    pub(crate) began: Instant,
    /// `models/{id}`.
    pub(crate) model: String,
    pub(crate) step: u64,
    pub(crate) job_seconds: f64,
    pub(crate) job_steps: u64,
    /// Held-out, dB.
    pub(crate) psnr: Option<f64>,
    /// Slots of the people that it knows.
    pub(crate) slots: Vec<u32>,
    /// Longest side of the training images, pixels; 0: the captures' own.
    pub(crate) image_size: u32,
    /// SHA-256 of the shards, in the order of the slots.
    pub(crate) shards: Vec<String>,
}

/// Downloads `wanted` of the first complete one of `checkpoints`.
///
/// A damaged one is logged and the next one is tried; `None` if none is complete. A store that
/// can't answer is a failure instead, since the newest checkpoint may be intact.
pub(crate) fn first_whole(
    context: &JobContext,
    checkpoints: &[Checkpoint],
    wanted: &[&str],
) -> Result<Option<Downloaded>, JobFailure> {
    for checkpoint in checkpoints {
        match download(context, checkpoint, wanted)? {
            Ok(downloaded) => return Ok(Some(downloaded)),
            Err(reason) => {
                tracing::warn!(
                    job = context.claim.job,
                    checkpoint = checkpoint.name,
                    reason,
                    "a checkpoint is torn"
                );
            }
        }
    }
    Ok(None)
}

/// The first complete checkpoint of the inputs, where the best one comes first, ready to `purpose`
/// ("render", "measure"), with its catalogue entry.
pub(crate) fn load_renderer(
    context: &JobContext,
    inputs: &Inputs,
    purpose: &str,
) -> Result<(Renderer, Downloaded), JobFailure> {
    context.report_pieces("loading", 0, 1);
    load(context, shard::model(inputs), &inputs.checkpoints, purpose)
}

/// The first complete one of the `checkpoints` of the model that people call `model`, as [`load_renderer`].
pub(crate) fn load(
    context: &JobContext,
    model: &str,
    checkpoints: &[Checkpoint],
    purpose: &str,
) -> Result<(Renderer, Downloaded), JobFailure> {
    let found = first_whole(context, checkpoints, &[files::WEIGHTS, files::STATE])?;
    let found = found.ok_or_else(|| JobFailure::Failed {
        code: "NO_CHECKPOINT",
        message: format!("{model} has no whole checkpoint to {purpose}: train it first"),
    })?;
    let renderer = Renderer::load(found.folder.path(), &context.device.device)
        .map_err(|error| JobFailure::failed("INTERNAL", "loading the checkpoint", &error))?;
    Ok((renderer, found))
}

/// Downloads one checkpoint; the inner error describes its damage.
fn download(
    context: &JobContext,
    checkpoint: &Checkpoint,
    wanted: &[&str],
) -> Result<Result<Downloaded, String>, JobFailure> {
    let Some(object) = &checkpoint.manifest else {
        return Ok(Err("it has no manifest".into()));
    };
    let manifest: Manifest = match fetch(context, object)? {
        Ok(bytes) => match Manifest::from_json(&bytes) {
            Ok(manifest) => manifest,
            Err(error) => return Ok(Err(format!("{}: {error}", object.key))),
        },
        Err(reason) => return Ok(Err(reason)),
    };
    let folder = context.folder().map_err(|error| local(&error))?;
    // A checkpoint is complete without occupancy grids, for early ones have none, and without
    // refined poses and exposures.
    let optional = manifest.objects.iter().map(|it| &*it.file);
    let optional = optional.filter(|file| {
        [files::OCCUPANCY, files::REFINEMENT, files::EXPOSURES].contains(file)
            || files::is_refined_poses(file)
    });
    for file in wanted.iter().copied().chain(optional) {
        let Some(entry) = manifest.object(file) else {
            return Ok(Err(format!("its manifest names no {file}")));
        };
        let object = ObjectRef {
            key: entry.key.clone(),
            bytes: entry.bytes,
            sha256: entry.sha256.clone(),
        };
        match fetch(context, &object)? {
            Ok(bytes) => {
                fs::write(folder.path().join(file), bytes).map_err(|error| local(&error))?
            }
            Err(reason) => return Ok(Err(reason)),
        }
    }
    Ok(Ok(Downloaded {
        folder,
        manifest,
        checkpoint: checkpoint.clone(),
    }))
}

fn fetch(
    context: &JobContext,
    object: &ObjectRef,
) -> Result<Result<bytes::Bytes, String>, JobFailure> {
    match context.get(object)? {
        Ok(bytes) => Ok(Ok(bytes)),
        Err(error) if error.is_torn() => Ok(Err(error.to_string())),
        Err(error) => Err(error.into()),
    }
}

/// Uploads the checkpoint in `folder` and makes it the model's newest; its size in bytes.
pub(crate) fn publish(
    context: &JobContext,
    folder: &Path,
    saved: &Saved,
) -> Result<u64, JobFailure> {
    let model_id = id(Collection::Models, &saved.model)?;
    let prefix = keys::checkpoint(model_id, context.job_id()?, context.claim.token, saved.step);
    let mut objects = Vec::new();
    let always = [
        files::WEIGHTS,
        files::OPTIMISER,
        files::OCCUPANCY,
        files::STATE,
    ];
    let extra = extra_files(folder).map_err(|error| local(&error))?;
    for file in always.map(str::to_owned).into_iter().chain(extra) {
        let bytes = fs::read(folder.join(&file)).map_err(|error| local(&error))?;
        let object = context.put(&format!("{prefix}/{file}"), bytes)?;
        objects.push(ManifestObject {
            file,
            key: object.key,
            bytes: object.bytes,
            sha256: object.sha256,
        });
    }
    let manifest = Manifest {
        version: manifest::VERSION,
        model: saved.model.clone(),
        step: saved.step,
        job: context.claim.job.clone(),
        job_seconds: saved.job_seconds,
        job_steps: saved.job_steps,
        objects,
    };
    let json = serde_json::to_vec_pretty(&manifest).map_err(|error| {
        JobFailure::failed("INTERNAL", "writing a checkpoint's manifest", &error)
    })?;
    let object = context.put(&format!("{prefix}/{}", files::MANIFEST), json)?;
    let checkpoint = Checkpoint {
        name: names::checkpoint(&saved.model, saved.step),
        step: saved.step,
        manifest: Some(object),
        bytes: manifest.bytes(),
        psnr: saved.psnr,
        slots: saved.slots.clone(),
        image_size: saved.image_size,
        shards: saved.shards.clone(),
        ..Checkpoint::default()
    };
    context.publish(checkpoint, saved.began.elapsed().as_secs_f64())?;
    Ok(manifest.bytes())
}

/// Files in `folder` that only some checkpoints have.
fn extra_files(folder: &Path) -> std::io::Result<Vec<String>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder)? {
        let name = entry?.file_name().to_string_lossy().into_owned();
        let extra = [files::REFINEMENT, files::EXPOSURES, files::PREVIEW].contains(&&*name);
        if extra || files::is_refined_poses(&name) {
            found.push(name);
        }
    }
    found.sort_unstable();
    Ok(found)
}

/// A fault of this machine's disk, and not of the job.
pub(crate) fn local(error: &std::io::Error) -> JobFailure {
    JobFailure::machine("the worker's temporary folder", error)
}

#[cfg(test)]
mod tests;
