//! Hands queued jobs to workers.

use crate::context::Context;
use crate::error::RequestError;
use crate::store::{LeasedJob, NewWorker};
use yoto_proto::v1::Lease;

/// Adds a worker and returns its id.
///
/// # Errors
/// When the store fails.
pub async fn register(context: &Context, new: NewWorker) -> Result<String, RequestError> {
    let (name, device) = (new.display_name.clone(), new.device.clone());
    let id = context.store.register_worker(new).await?;
    tracing::info!(
        worker = id,
        name,
        adapter = device.adapter,
        gpu = device.gpu,
        "worker registered"
    );
    Ok(id)
}

/// Leases the first queued job that the worker may run, with its inputs. If there is none, and `help` is set,
/// leases a part of a running render. A repeated `request_id` gets the same lease again. A job whose inputs
/// can't be found FAILS.
///
/// # Errors
/// When the worker is unknown or the store fails.
pub async fn lease(
    context: &Context,
    worker_id: &str,
    request_id: &str,
    help: bool,
) -> Result<Option<Lease>, RequestError> {
    let lease_seconds = context.config.lease_seconds;
    let outcome = (context
        .store
        .lease_job(worker_id, request_id, help, lease_seconds))
    .await?;
    context.roster.asked(worker_id, context.config.clock.time());
    for (job, reason) in &outcome.failed {
        tracing::warn!(job, reason, "job failed before it could be leased");
        context.changes.announce(job);
    }
    let Some(leased) = outcome.leased else {
        return Ok(None);
    };
    let LeasedJob {
        job,
        token,
        inputs,
        helps,
    } = leased;
    context.changes.announce(&job.name);
    tracing::info!(
        job = job.name,
        token,
        worker = worker_id,
        helps,
        "job leased"
    );
    Ok(Some(Lease {
        job: Some(job),
        token,
        lease_seconds,
        inputs: Some(inputs),
        helps,
    }))
}
