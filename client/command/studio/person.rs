//! A person and their capture, uploaded to the service.

use crate::upload_files::upload_files;
use anyhow::Context;
use std::path::Path;
use yoto_client::YotoClient;
use yoto_import::capture_dir::CaptureDir;
use yoto_proto::v1::{Subject, job_result};
use yoto_terminal::output::others;
use yoto_terminal::progress::{ProgressDisplay, count};

/// Adds a person called `name`, uploads the capture folder and waits until it is ingested.
///
/// # Errors
/// A capture that can't be read or is rejected, with its faults.
pub(crate) async fn upload(
    client: &YotoClient,
    name: &str,
    consent: &str,
    capture: &Path,
) -> anyhow::Result<Subject> {
    let capture = CaptureDir::open(capture)?;
    let subject = client.create_subject(name, consent).await?;
    let mut display = ProgressDisplay::new(format!("capture of {name}"));
    let (mut sent, total, frames) = (0, capture.bytes, capture.frames());
    let uploaded = client
        .upload_capture(&subject.name, upload_files(capture.files), |bytes| {
            sent += bytes;
            display.bytes(sent, total);
        })
        .await?;
    let job = client
        .wait_for_job(&uploaded.ingest_job, |job| display.job(job))
        .await;
    let job = job.with_context(|| format!("ingesting the capture of {name}"))?;
    display.finish_in_detail(&format!("{} uploaded and ingested", count(frames, "frame")));
    if let Some(job_result::Kind::Ingest(ingest)) = job.result.and_then(|result| result.kind) {
        for note in ingest.notes.iter().chain(&ingest.warnings) {
            detail!("note: {}", others(note));
        }
    }
    Ok(subject)
}
