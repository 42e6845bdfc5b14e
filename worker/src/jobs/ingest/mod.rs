//! Turns an uploaded capture into a training shard.
//!
//! The worker fetches the files, `yoto_ingest` reads them in a child process, and the worker stores
//! the result. A fault of the store or of this machine never rejects a capture: the job is retried.

mod fetch;
mod thumbnail;

use super::context::id;
use super::{JobContext, JobFailure};
use fetch::fetch;
use yoto_ingest::{IngestError, Ingested, Progress, Stage, ingest};
use yoto_proto::keys;
use yoto_proto::names::Collection;
use yoto_proto::v1::{IngestResult, IngestSpec};
use yoto_proto::worker::v1::Inputs;

/// Fetches, checks and packs the capture, and stores the shard.
///
/// # Errors
/// [`JobFailure::Rejected`] with the faults of the upload; faults of the store and of
/// this machine.
pub fn run(
    context: &JobContext,
    spec: &IngestSpec,
    inputs: &Inputs,
) -> Result<IngestResult, JobFailure> {
    let folder = context.folder().map_err(|error| {
        JobFailure::try_later("MACHINE", "making a folder for the upload", &error)
    })?;
    let files = fetch(context, inputs, folder.path())?;
    let watch = |progress: Option<&Progress>| {
        if let Some(progress) = progress {
            let stage = match progress.stage {
                Stage::Poses => "finding poses",
                Stage::Decoding => "decoding",
            };
            context.report_pieces(stage, progress.done, progress.total);
        }
        context.check()
    };
    let Ingested {
        shard,
        report,
        notes,
        warnings,
    } = ingest(folder.path(), files, &context.ingest, watch)?;
    let capture = id(Collection::Captures, &spec.capture)?;
    let key = keys::shard(capture, context.job_id()?, context.claim.token);
    let job = context.job_id()?;
    let of_capture = |file: &str| keys::of_capture(capture, job, context.claim.token, file);
    let thumbnail = match thumbnail::of(&shard) {
        Ok(Some(png)) => Some(context.put(&of_capture(keys::THUMBNAIL), png)?),
        Ok(None) => None,
        Err(error) => {
            return Err(JobFailure::Failed {
                code: "INTERNAL",
                message: format!("writing a thumbnail: {error}"),
            });
        }
    };
    let [width, height] = shard.track.image_size;
    let numbers = || shard.track.frames.iter().map(|frame| frame.index);
    Ok(IngestResult {
        frames: shard.frames() as u32,
        width,
        height,
        first_frame: numbers().min(),
        last_frame: numbers().max(),
        notes,
        warnings,
        check: Some(context.put(&of_capture(keys::CHECK), report)?),
        thumbnail,
        shard: Some(context.put(&key, shard.to_bytes())?),
    })
}

impl From<IngestError<JobFailure>> for JobFailure {
    fn from(error: IngestError<JobFailure>) -> Self {
        let later = |code, message| Self::TryLater { code, message };
        match error {
            IngestError::Rejected(found) => Self::Rejected(found),
            IngestError::Machine(message) => later("MACHINE", message),
            IngestError::Killed(message) => later("KILLED", message),
            IngestError::Broken(message) => Self::Failed {
                code: "INTERNAL",
                message,
            },
            IngestError::Stopped(failure) => failure,
        }
    }
}

#[cfg(test)]
mod tests;
