//! Uploads without the client's checks: faulty captures reach the service.

use anyhow::Context;
use std::path::Path;
use yoto_client::{FileSource, UploadFile, YotoClient};
use yoto_proto::pose_track::describe;
use yoto_proto::v1::job::State;
use yoto_proto::v1::{Capture, Job, capture};

/// Outcome of an upload.
pub struct Ingested {
    /// `subjects/{id}`.
    pub subject: String,
    /// The ingest job at its end.
    pub job: Job,
    /// The capture at its end.
    pub capture: Capture,
    /// The violations, one line each.
    pub said: Vec<String>,
}

impl Ingested {
    /// The codes of the violations.
    pub fn codes(&self) -> Vec<&str> {
        let found = self.capture.violations.iter();
        found.map(|violation| violation.code.as_str()).collect()
    }
}

/// A file in memory.
pub fn file(path: &str, bytes: impl Into<Vec<u8>>) -> UploadFile {
    UploadFile {
        path: path.into(),
        source: FileSource::Memory(bytes.into()),
    }
}

/// All files below `dir` that the service should get, under their relative names.
///
/// # Errors
/// When the folder can't be read.
pub fn files(dir: &Path) -> anyhow::Result<Vec<UploadFile>> {
    let mut found = Vec::new();
    let mut folders = vec![dir.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder)? {
            let path = entry?.path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(dir)?.to_str().context("a plain name")?;
                found.push(file(name, std::fs::read(&path)?));
            }
        }
    }
    found.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(found)
}

/// Uploads `files` as a capture of a new person and waits for the ingest to end.
///
/// # Errors
/// When the service refuses, or capture and job disagree.
pub async fn ingest(
    client: &YotoClient,
    name: &str,
    files: Vec<UploadFile>,
) -> anyhow::Result<Ingested> {
    let subject = client.create_subject(name, "made up").await?.name;
    let capture = client.upload_capture(&subject, files, |_| {}).await?;
    let mut watch = client.watch_job(&capture.ingest_job);
    let mut last = None;
    while let Some(job) = watch.next().await? {
        last = Some(job);
    }
    let capture = client.get_capture(&capture.name).await?;
    let job = last.context("the ingest was watched to its end")?;
    anyhow::ensure!(
        (capture.state() == capture::State::Rejected) == (job.state() == State::Failed),
        "capture and job disagree: {capture:?} {job:?}"
    );
    Ok(Ingested {
        said: capture.violations.iter().map(describe).collect(),
        subject,
        job,
        capture,
    })
}
