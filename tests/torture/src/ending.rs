//! What the service says and stores at the end.

use super::calls::Calls;
use super::checker::{Final, FinalJob};
use super::history::Event;
use super::workload::Workload;
use anyhow::{Context, Result};
use std::collections::BTreeSet;
use std::time::{Duration, Instant};
use yoto_proto::v1::job;
use yoto_server::fsck::{Place, fsck};

/// Waits until no job is open, for at most `limit`. The checker reports jobs that stay open.
///
/// # Errors
/// When the service gives no definite answer.
pub(crate) async fn settle(calls: &Calls, limit: Duration) -> Result<()> {
    let began = Instant::now();
    let open = [job::State::Queued, job::State::Running];
    while began.elapsed() < limit && !calls.list_jobs(&open).await?.is_empty() {
        tokio::time::sleep(Duration::from_millis(300)).await;
    }
    Ok(())
}

/// Adds the jobs and captures of a service, and what the check of its `place` finds wrong with objects.
///
/// # Errors
/// When the service gives no definite answer, or can't be checked.
pub(crate) async fn collect(
    calls: &Calls,
    place: &Place,
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
    }
    for model in models {
        let checkpoints = calls.checkpoints(&model).await?;
        let spare = checkpoints.iter().filter(|it| it.kept_for.is_empty());
        end.spare.insert(model, spare.count());
    }
    let report = fsck(place, |_| {})
        .await
        .context("the check of all objects")?;
    let faults = report.missing.into_iter().chain(report.damaged);
    end.damaged.extend(faults.map(|it| (it.key, it.what)));
    end.orphans = report.orphans.len();
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
pub(crate) async fn repeat(calls: &Calls, workload: &Workload, end: &mut Final) -> Result<()> {
    for (request, job) in workload.asked() {
        if end.jobs.get(&job).is_some_and(|it| !it.state.is_empty()) {
            let again = calls.create_job(&request).await;
            let again = again.with_context(|| format!("repeating the call that made {job}"))?;
            end.repeated.push((request.request_id, again.name));
        }
    }
    Ok(())
}
