//! Hands queued jobs to workers.

use crate::context::Context;
use prost::Message;
use yoto_process::metrics::METRICS;
use yoto_proto::limits::ANSWER_BYTES;
use yoto_proto::names::Collection;
use yoto_proto::orders;
use yoto_proto::v1::JobError;
use yoto_proto::worker::v1::Lease;
use yoto_request::RequestError;
use yoto_store::{Ending, JobKind, LeaseKey, LeasedJob, NewWorker, StoreError, Tenant};

/// Bytes of an answer besides its lease.
const MARGIN: usize = 64;

/// Adds a worker and returns its id.
///
/// # Errors
/// When the store fails.
pub(crate) async fn register(
    context: &Context,
    tenant: &Tenant,
    new: NewWorker,
) -> Result<String, RequestError> {
    let (name, device) = (new.display_name.clone(), new.device.clone());
    let (version, order_level) = (new.version.clone(), new.order_level);
    let id = context.store.register_worker(tenant, new).await?;
    tracing::info!(
        worker = id,
        name,
        adapter = device.adapter,
        gpu = device.gpu,
        version,
        "worker registered"
    );
    if order_level < orders::LEVEL {
        tracing::warn!(
            worker = id,
            version,
            order_level,
            newest = orders::LEVEL,
            "the worker is of an earlier version: it gets no orders that it does not understand"
        );
    }
    Ok(id)
}

/// Leases the first queued job that the worker may run, with its inputs. If there is none, and `help` is set,
/// leases a part of a running render. A repeated `request_id` gets the same lease again. A job whose inputs
/// can't be found, or are too large for an answer, FAILS.
///
/// # Errors
/// When the worker is unknown or the store fails.
pub(crate) async fn lease(
    context: &Context,
    tenant: &Tenant,
    worker_id: &str,
    request_id: &str,
    help: bool,
) -> Result<Option<Lease>, RequestError> {
    let lease_seconds = context.config.lease_seconds;
    let outcome = (context
        .store
        .lease_job(tenant, worker_id, request_id, help, lease_seconds))
    .await?;
    for (job, reason) in &outcome.failed {
        tracing::warn!(job, reason, "job failed before it could be leased");
        context.notifier.announce_end(job);
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
    let name = job.name.clone();
    let kind = job.spec.as_ref().and_then(JobKind::of);
    context.notifier.announce(&name);
    let lease = Lease {
        job: Some(job),
        token,
        lease_seconds,
        inputs: Some(inputs),
        helps,
    };
    let bytes = lease.encoded_len();
    if bytes > ANSWER_BYTES - MARGIN {
        let job_id = Collection::Jobs
            .parse(&name)
            .map_err(|error| StoreError::Corrupt {
                what: "jobs.id",
                detail: error.to_string(),
            })?;
        let key = LeaseKey {
            job_id: job_id.to_owned(),
            worker_id: worker_id.to_owned(),
            token,
        };
        end_unreadable(context, tenant, &key, bytes, helps).await?;
        return Ok(None);
    }
    if let Some(kind) = kind {
        METRICS.leased(kind.as_str());
    }
    tracing::info!(job = name, token, worker = worker_id, helps, "job leased");
    Ok(Some(lease))
}

/// Ends a lease of `bytes` bytes, which is too large for any worker to read.
async fn end_unreadable(
    context: &Context,
    tenant: &Tenant,
    lease: &LeaseKey,
    bytes: usize,
    helps: bool,
) -> Result<(), RequestError> {
    let message = format!(
        "the order with its files has {bytes} bytes: a worker accepts at most {ANSWER_BYTES}; divide it into \
         several orders"
    );
    tracing::warn!(
        job = lease.job_id,
        bytes,
        "a lease is too large for a worker"
    );
    let ending = match helps {
        // The job belongs to the worker that runs it.
        true => Ending::Returned,
        false => Ending::Failed(JobError {
            code: "TOO_LARGE".to_owned(),
            message,
            ..JobError::default()
        }),
    };
    context.store.end_job(tenant, lease, ending).await?;
    let job = Collection::Jobs.name(&lease.job_id);
    context.notifier.announce_end(&job);
    Ok(())
}
