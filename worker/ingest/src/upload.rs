//! One upload from files to shard, through the child.

use super::failure::{IngestError, machine};
use super::order::{Order, Outcome, Progress};
use super::settings::IngestSettings;
use super::supervise;
use std::fs::File;
use std::io::Read;
use std::path::Path;
use yoto_capture::Shard;
use yoto_media::archive::Files;

/// Largest report of the check, bytes; a report of 100,000 frames has a hundredth of this.
const MAX_REPORT: u64 = 16 << 20;

/// An ingested upload.
#[derive(Debug)]
pub struct Ingested {
    /// Frames for training, and their pose track.
    pub shard: Shard,
    /// The check's report, as JSON.
    pub report: Vec<u8>,
    /// A summary of what was read, for people.
    pub notes: Vec<String>,
    /// Warnings of the check, for people.
    pub warnings: Vec<String>,
}

/// Reads the capture of `files` (path in it to path on disk) in a child process. `folder` is for
/// the child only, and also holds the files.
///
/// `watch` is called several times per second, with the child's progress if it has changed. If it fails, the child is
/// killed.
///
/// # Errors
/// Faults of the capture or of this machine, and errors of `watch`.
pub fn ingest<E>(
    folder: &Path,
    files: Files,
    settings: &IngestSettings,
    mut watch: impl FnMut(Option<&Progress>) -> Result<(), E>,
) -> Result<Ingested, IngestError<E>> {
    let order = Order {
        files,
        ffmpeg: settings.ffmpeg.clone(),
        pose_model: settings.pose_model.clone(),
        ..Order::new(folder, &settings.limits)
    };
    let prepared = match supervise::run(settings, &order, &mut watch)? {
        Outcome::Done(prepared) => prepared,
        Outcome::Rejected(found) => {
            let found = found.into_iter().map(Into::into);
            return Err(IngestError::Rejected(found.collect()));
        }
        Outcome::Machine(message) => return Err(IngestError::Machine(message)),
    };
    let bytes = std::fs::read(order.shard())
        .map_err(|error| machine("reading the shard that was made", &error))?;
    // The child read untrusted bytes, so its output is checked.
    let shard = Shard::from_bytes(bytes)
        .map_err(|error| IngestError::Broken(format!("the shard that was made: {error}")))?;
    Ok(Ingested {
        shard,
        report: report(&order)?,
        notes: prepared.notes,
        warnings: prepared.warnings,
    })
}

/// The check's report, written by the child; valid JSON.
fn report<E>(order: &Order) -> Result<Vec<u8>, IngestError<E>> {
    let bytes = File::open(order.check())
        .and_then(|file| {
            let mut bytes = Vec::new();
            file.take(MAX_REPORT).read_to_end(&mut bytes).map(|_| bytes)
        })
        .map_err(|error| machine("reading the check's report", &error))?;
    serde_json::from_slice::<serde::de::IgnoredAny>(&bytes)
        .map_err(|error| IngestError::Broken(format!("the check's report: {error}")))?;
    Ok(bytes)
}
