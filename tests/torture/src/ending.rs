//! What the service says and stores at the end.

use super::calls::Calls;
use super::checker::{Final, FinalJob};
use super::history::Event;
use super::records::Records;
use super::workload::{Workload, is_ended};
use anyhow::{Context, Result};
use std::collections::BTreeSet;
use std::path::Path;
use std::time::{Duration, Instant};
use yoto_proto::manifest::Manifest;
use yoto_proto::sha256_hex;
use yoto_proto::v1::{Job, JobResult, ObjectRef, job, job_result};

/// Waits until no job is open, for at most `limit`. The checker reports jobs that stay open.
///
/// # Errors
/// When the service gives no definite answer.
pub async fn settle(calls: &Calls, limit: Duration) -> Result<()> {
    let began = Instant::now();
    let open = [job::State::Queued, job::State::Running];
    while began.elapsed() < limit && !calls.list_jobs(&open).await?.is_empty() {
        tokio::time::sleep(Duration::from_millis(300)).await;
    }
    Ok(())
}

/// Adds the jobs, captures and objects of a service with its objects in `folder`.
///
/// # Errors
/// When the service gives no definite answer.
pub async fn collect(
    calls: &Calls,
    records: &Records,
    folder: &Path,
    events: &[Event],
    end: &mut Final,
) -> Result<()> {
    let mut models = BTreeSet::new();
    for listed in calls.list_jobs(&[]).await? {
        let job = calls.job(&listed.name).await?;
        if !job.model.is_empty() {
            models.insert(job.model.clone());
        }
        let attempts = job.attempts.iter();
        let attempts = attempts.map(|it| (it.number, it.outcome().as_str_name().to_owned()));
        let last = FinalJob {
            state: job.state().as_str_name().to_owned(),
            error: job.error.as_ref().map_or_else(String::new, |error| {
                format!("{}: {}", error.code, error.message)
            }),
            owner: job.owner.clone(),
            attempts: attempts.collect(),
        };
        end.jobs.insert(job.name.clone(), last);
        let result = records.result(&job.name).await?;
        for object in objects_of(&job, result.as_ref()) {
            check(folder, object, end);
        }
    }
    for model in models {
        let checkpoints = calls.checkpoints(&model).await?;
        let spare = checkpoints.iter().filter(|it| it.kept_for.is_empty());
        end.spare.insert(model, spare.count());
        for checkpoint in checkpoints {
            let manifest = records.manifest(&checkpoint.name).await?;
            let manifest = manifest.context("a checkpoint has a manifest")?;
            let Some(bytes) = check(folder, &manifest, end) else {
                continue;
            };
            for object in Manifest::from_json(&bytes)?.objects {
                let object = ObjectRef {
                    key: object.key,
                    bytes: object.bytes,
                    sha256: object.sha256,
                };
                check(folder, &object, end);
            }
        }
    }
    for event in events {
        let Event::Uploaded { capture } = event else {
            continue;
        };
        if let Ok(found) = calls.capture(capture).await {
            let state = found.state().as_str_name().to_owned();
            let reasons = !found.violations.is_empty();
            end.captures.insert(capture.clone(), (state, reasons));
        }
    }
    Ok(())
}

/// Repeats each acknowledged call that made a job which is still there.
///
/// # Errors
/// When the service gives no definite answer, or refuses.
pub async fn repeat(calls: &Calls, workload: &Workload, end: &mut Final) -> Result<()> {
    for (request, job) in workload.asked() {
        if end.jobs.get(&job).is_some_and(|it| !it.state.is_empty()) {
            let again = calls.create_job(&request).await;
            let again = again.with_context(|| format!("repeating the call that made {job}"))?;
            end.repeated.push((request.request_id, again.name));
        }
    }
    Ok(())
}

/// The objects that a job's result names, if it has ended.
fn objects_of<'a>(job: &Job, result: Option<&'a JobResult>) -> Vec<&'a ObjectRef> {
    match result.and_then(|result| result.kind.as_ref()) {
        Some(job_result::Kind::Ingest(ingest)) if is_ended(job.state()) => {
            let shard = ingest.shard.iter().chain(&ingest.check);
            shard.chain(&ingest.thumbnail).collect()
        }
        Some(job_result::Kind::Render(render)) => {
            let files = render.files.iter();
            files.filter_map(|file| file.object.as_ref()).collect()
        }
        Some(job_result::Kind::Export(export)) => {
            let files = export.files.iter();
            files.filter_map(|file| file.object.as_ref()).collect()
        }
        _ => Vec::new(),
    }
}

/// Hashes the object's file. Returns its bytes if the hash matches.
fn check(folder: &Path, object: &ObjectRef, end: &mut Final) -> Option<Vec<u8>> {
    let fault = match std::fs::read(folder.join(&object.key)) {
        Ok(bytes) if bytes.len() as u64 == object.bytes && sha256_hex(&bytes) == object.sha256 => {
            return Some(bytes);
        }
        Ok(bytes) => format!(
            "{} bytes, of {}, or another hash",
            bytes.len(),
            object.bytes
        ),
        Err(error) => error.to_string(),
    };
    end.damaged.push((object.key.clone(), fault));
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_object_with_a_flipped_bit_is_damaged() {
        let dir = tempfile::tempdir().expect("a folder");
        std::fs::write(dir.path().join("x"), b"abc").expect("writes");
        let object = |key: &str, bytes: &[u8]| ObjectRef {
            key: key.into(),
            bytes: bytes.len() as u64,
            sha256: sha256_hex(bytes),
        };
        let mut end = Final::default();
        assert!(check(dir.path(), &object("x", b"abc"), &mut end).is_some());
        assert!(end.damaged.is_empty());
        check(dir.path(), &object("x", b"abb"), &mut end);
        check(dir.path(), &object("y", b"abc"), &mut end);
        assert_eq!(end.damaged.len(), 2);
    }
}
