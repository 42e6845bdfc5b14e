//! Hands queued jobs to workers.

use super::inputs;
use crate::{
    context::Context,
    error::RequestError,
    store::{Ending, LeaseKey, NewWorker},
};
use std::time::SystemTime;
use yoto_proto::{
    names::Collection,
    v1::{Job, JobError, Lease},
};

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

/// Leases the oldest queued job that the worker can run, with its inputs, if there is one.
///
/// # Errors
/// When the worker is unknown or the store fails. A job whose inputs can't be read goes
/// back to the queue.
pub async fn lease(context: &Context, worker_id: &str) -> Result<Option<Lease>, RequestError> {
    let lease_seconds = context.config.lease_seconds;
    let leased = context.store.lease_job(worker_id, lease_seconds).await?;
    context.roster.asked(worker_id, SystemTime::now());
    let Some(job) = leased else {
        return Ok(None);
    };
    context.changes.announce();
    tracing::info!(
        job = job.name,
        token = job.lease,
        worker = worker_id,
        "job leased"
    );
    let spec = job.spec.clone().unwrap_or_default();
    let id = Collection::Jobs.parse(&job.name).unwrap_or_default();
    match inputs::resolve(context, id, &spec).await {
        Ok(inputs) => {
            let token = job.lease;
            Ok(Some(Lease {
                job: Some(job),
                token,
                lease_seconds,
                inputs: Some(inputs),
            }))
        }
        Err(error) => {
            give_back(context, &job, &error).await;
            Err(error)
        }
    }
}

/// Puts a job back whose inputs can't be found. It is tried later, and not for ever: at once it would come
/// first again, and no job behind it would ever run. If this fails as well, the reaper takes the job back
/// when the lease expires.
async fn give_back(context: &Context, job: &Job, error: &RequestError) {
    let Ok(id) = Collection::Jobs.parse(&job.name) else {
        return;
    };
    let key = LeaseKey {
        job_id: id.to_owned(),
        token: job.lease,
    };
    let missing = JobError {
        code: "INPUTS".to_owned(),
        message: format!("its inputs can't be found: {error}"),
        violations: Vec::new(),
    };
    if let Err(error) = context.store.end_job(&key, Ending::TryLater(missing)).await {
        tracing::warn!(job = job.name, %error, "could not put a job back into the queue");
    }
    context.changes.announce();
}
