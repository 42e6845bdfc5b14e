//! Turning an uploaded capture into a training shard.
//!
//! What users upload is decoded in a child process: this program, started again, with limits
//! on memory and time, so that a file which makes a decoder crash, hang or swell ends that
//! process only. The worker fetches the files, waits, and stores what came out.
//!
//! Everything wrong with the upload is told with file, frame and field. A fault of the store
//! or of this machine rejects nothing: the job is tried again. A limit that is hit is the
//! upload's fault, and is named.

mod capture;
mod child;
mod failure;
mod local;
mod order;
mod prepare;
mod reader;
mod settings;
mod supervise;
mod unpack;

pub use child::become_ingest_child_if_asked;
pub use failure::ReadFailure;
pub use local::LocalCapture;
pub use settings::IngestSettings;

use super::{JobContext, JobFailure, context::id};
use order::{Order, Outcome};
use std::fs::File;
use std::io::Read;
use yoto_capture::Shard;
use yoto_proto::{
    keys,
    names::Collection,
    v1::{IngestResult, IngestSpec, Inputs},
};

/// Largest report of the check, bytes; one of 100,000 frames has a hundredth.
const MAX_REPORT: u64 = 16 << 20;
/// Most violations reported of one capture; a wrong export repeats in every frame.
const MAX_VIOLATIONS: usize = 20;

/// Fetches the capture, has it checked and packed, and stores the shard.
///
/// # Errors
/// [`JobFailure::Rejected`] with what is wrong with the upload; faults of the store and of
/// this machine.
pub fn run(
    context: &JobContext,
    spec: &IngestSpec,
    inputs: &Inputs,
) -> Result<IngestResult, JobFailure> {
    let folder = tempfile::Builder::new()
        .prefix("yoto-ingest-")
        .tempdir()
        .map_err(|error| machine("making a folder for the upload", &error))?;
    let mut order = Order::new(folder.path(), &context.ingest.limits);
    for (number, file) in inputs.files.iter().enumerate() {
        context.check()?;
        context.report_pieces("fetching", number, inputs.files.len());
        let Some(object) = &file.object else { continue };
        // Under a number: what the file is called leads nowhere on this disk.
        let path = folder.path().join(format!("upload-{number:06}"));
        context.get_to_file(object, &path)?;
        order.files.insert(file.path.clone(), path);
    }
    let prepared = match supervise::run(context, &order)? {
        Outcome::Done(prepared) => prepared,
        Outcome::Rejected(found) => {
            return Err(JobFailure::Rejected(
                found.into_iter().map(Into::into).collect(),
            ));
        }
        Outcome::Machine(message) => {
            return Err(JobFailure::TryLater {
                code: "MACHINE",
                message,
            });
        }
    };
    let bytes = std::fs::read(order.shard())
        .map_err(|error| machine("reading the shard that was made", &error))?;
    // The child read hostile bytes: its word is checked.
    let shard = Shard::from_bytes(bytes)
        .map_err(|error| JobFailure::failed("INTERNAL", "the shard that was made", &error))?;
    let report = read_report(&order)?;
    let capture = id(Collection::Captures, &spec.capture)?;
    let key = keys::shard(capture, context.job_id()?, context.token);
    let check = keys::check(capture, context.job_id()?, context.token);
    let [width, height] = shard.track.image_size;
    Ok(IngestResult {
        frames: shard.frames() as u32,
        width,
        height,
        notes: prepared.notes,
        warnings: prepared.warnings,
        check: Some(context.put(&check, report)?),
        shard: Some(context.put(&key, shard.to_bytes())?),
    })
}

/// The check's report that the child wrote; JSON, whatever else.
fn read_report(order: &Order) -> Result<Vec<u8>, JobFailure> {
    let wrong =
        |error: &dyn std::error::Error| JobFailure::failed("INTERNAL", "the check's report", error);
    let path = order.check();
    let bytes = File::open(&path)
        .and_then(|file| {
            let mut bytes = Vec::new();
            file.take(MAX_REPORT).read_to_end(&mut bytes).map(|_| bytes)
        })
        .map_err(|error| machine("reading the check's report", &error))?;
    serde_json::from_slice::<serde::de::IgnoredAny>(&bytes).map_err(|error| wrong(&error))?;
    Ok(bytes)
}

fn machine(doing: &str, error: &std::io::Error) -> JobFailure {
    JobFailure::try_later("MACHINE", doing, error)
}

#[cfg(test)]
mod tests;
