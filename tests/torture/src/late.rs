//! Writes with stale claims: by a worker that lost the job, and by one that never had it.

use super::calls::{Calls, answered};
use super::history::{Event, History};
use super::records::Records;
use anyhow::{Context, Result};
use tonic::Status;
use yoto_proto::orders::LEVEL;
use yoto_proto::reasons;
use yoto_proto::v1::{
    Checkpoint, ErrorReason, Job, JobAttempt, JobKind, JobResult, RenderedFile, WorkerDevice,
    job_attempt,
};
use yoto_proto::worker::v1::end_job_request::{Outcome, Returned};
use yoto_proto::worker::v1::{
    Claim, CommitOutputRequest, EndJobRequest, HeartbeatRequest, PublishCheckpointRequest,
    RegisterWorkerRequest, TakeRangeRequest,
};

/// Registers a worker that never gets a job.
///
/// # Errors
/// When the service refuses.
pub(crate) async fn register_stranger(calls: &Calls) -> Result<String> {
    let request = RegisterWorkerRequest {
        display_name: "stranger".into(),
        device: Some(WorkerDevice::default()),
        kinds: vec![JobKind::Train.into()],
        order_level: LEVEL,
        ..RegisterWorkerRequest::default()
    };
    let registered = answered(|| {
        let (mut service, request) = (calls.workers(), request.clone());
        async move { service.register_worker(request).await }
    });
    Ok(registered.await.context("registering a worker")?.worker)
}

/// Tries all late writes on a job that was just read.
///
/// # Errors
/// When there is no definite answer.
pub(crate) async fn write_late(
    calls: &Calls,
    history: &History,
    records: &Records,
    job: &Job,
    stranger: &str,
) -> Result<()> {
    let Some(newest) = job.attempts.last() else {
        return Ok(());
    };
    let tokens = records.tokens(&job.name).await?;
    let token_of = |attempt: &JobAttempt| {
        let index = usize::try_from(attempt.number)?.checked_sub(1);
        let token = index.and_then(|index| tokens.get(index).copied());
        token.with_context(|| format!("{} has no attempt {}", job.name, attempt.number))
    };
    let claim = |worker: &str, token| Claim {
        job: job.name.clone(),
        worker: worker.to_owned(),
        token,
    };
    let mut claims = vec![(
        "a worker that never had the job",
        claim(stranger, token_of(newest)?),
    )];
    let lost = job_attempt::Outcome::Lost;
    for attempt in job.attempts.iter().filter(|it| it.outcome() == lost) {
        let (old, token) = (&attempt.worker, token_of(attempt)?);
        claims.push(("the worker that lost it", claim(old, token)));
        // The newest holder, with a token from before its time.
        if newest.number != attempt.number && *old != newest.worker {
            claims.push(("an old token", claim(&newest.worker, token)));
        }
    }
    for (whose, claim) in claims {
        let heartbeat = HeartbeatRequest {
            claim: Some(claim.clone()),
            progress: None,
        };
        let beat = answered(|| {
            let (mut service, request) = (calls.workers(), heartbeat.clone());
            async move { service.heartbeat(request).await }
        });
        told(history, job, &format!("Heartbeat by {whose}"), beat.await)?;
        let publish = PublishCheckpointRequest {
            claim: Some(claim.clone()),
            checkpoint: Some(Checkpoint {
                step: u64::from(u32::MAX),
                ..Checkpoint::default()
            }),
            save_seconds: 0.5,
        };
        let published = answered(|| {
            let (mut service, request) = (calls.workers(), publish.clone());
            async move { service.publish_checkpoint(request).await }
        });
        let what = format!("PublishCheckpoint by {whose}");
        told(history, job, &what, published.await)?;
        let commit = CommitOutputRequest {
            claim: Some(claim.clone()),
            file: Some(RenderedFile::default()),
        };
        let committed = answered(|| {
            let (mut service, request) = (calls.workers(), commit.clone());
            async move { service.commit_output(request).await }
        });
        told(
            history,
            job,
            &format!("CommitOutput by {whose}"),
            committed.await,
        )?;
        let take = TakeRangeRequest {
            claim: Some(claim.clone()),
            pictures: 1,
            drawn: None,
        };
        let taken = answered(|| {
            let (mut service, request) = (calls.workers(), take.clone());
            async move { service.take_range(request).await }
        });
        told(history, job, &format!("TakeRange by {whose}"), taken.await)?;
        for (what, outcome) in [
            ("success", Outcome::Succeeded(JobResult::default())),
            ("return", Outcome::Returned(Returned {})),
        ] {
            let end = EndJobRequest {
                claim: Some(claim.clone()),
                outcome: Some(outcome),
            };
            let ended = answered(|| {
                let (mut service, request) = (calls.workers(), end.clone());
                async move { service.end_job(request).await }
            });
            let what = format!("EndJob with {what} by {whose}");
            told(history, job, &what, ended.await)?;
        }
    }
    Ok(())
}

fn told<T>(history: &History, job: &Job, what: &str, answer: Result<T, Status>) -> Result<()> {
    if let Err(status) = &answer {
        anyhow::ensure!(
            !super::calls::is_transient(status.code()),
            "{what}: {status}"
        );
    }
    history.record(Event::Late {
        job: job.name.clone(),
        what: what.to_owned(),
        accepted: !answer.is_err_and(|status| is_refused_as_late(&status)),
    })
}

/// Whether the claim itself was refused. If only the content was, the guard let the claim pass.
fn is_refused_as_late(status: &Status) -> bool {
    let reason = reasons::of(status);
    matches!(
        reason,
        Some(ErrorReason::StaleLease | ErrorReason::NotFound)
    )
}
