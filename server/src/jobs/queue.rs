//! Queues and cancels jobs.
//!
//! A job that the catalogue can't serve is refused now instead of failing later. The checked
//! entries (shards, the checkpoint to use, slots) are not removed while a job that uses them waits or
//! runs, so the checks still hold when the job is leased.

use super::aliases;
use super::checks::specs::check_spec;
use crate::context::Context;
use yoto_proto::checks;
use yoto_proto::limits::REQUEST_ID_BYTES;
use yoto_proto::text::one_line;
use yoto_proto::v1::{Job, JobSpec, job};
use yoto_request::RequestError;
use yoto_request::validation::all;
use yoto_store::{JobKind, NewJob, RequestKey, Tenant};

/// Checks a job, whose order is well-formed, and queues it.
///
/// # Errors
/// When the spec names a missing resource, or can't be served yet.
pub(crate) async fn create(
    context: &Context,
    tenant: &Tenant,
    mut new: NewJob,
    request: Option<RequestKey>,
) -> Result<Job, RequestError> {
    // Comes before everything that reads the catalogue: a repeated request gets its first answer, whatever has changed since.
    if let Some(id) = context.store.answered(tenant, request.as_ref()).await? {
        return Ok(context.store.job(tenant, &id).await?);
    }
    aliases::resolve(context, tenant, &mut new.spec).await?;
    check_spec(context, tenant, &new.spec).await?;
    let kind = JobKind::of(&new.spec);
    let request_id = id_of(&request);
    let job = context.store.create_job(tenant, new, request).await?;
    if let Some(kind) = kind {
        context.notifier.queued(tenant, kind);
    }
    let kind = kind.map_or("", JobKind::as_str);
    tracing::info!(job = job.name, kind, request_id, "job queued");
    Ok(job)
}

/// The job that an order would become, after the same checks as in [`create`].
///
/// # Errors
/// As [`create`].
pub(crate) async fn validate(
    context: &Context,
    tenant: &Tenant,
    mut new: NewJob,
) -> Result<Job, RequestError> {
    aliases::resolve(context, tenant, &mut new.spec).await?;
    check_spec(context, tenant, &new.spec).await?;
    context.store.check_consent(tenant, &new.spec).await?;
    let kind = JobKind::of(&new.spec);
    if let Some(kind) = kind {
        context.store.check_quota(tenant, kind).await?;
    }
    let kind = kind.map(JobKind::to_proto);
    Ok(Job {
        state: job::State::Queued.into(),
        kind: kind.unwrap_or_default().into(),
        spec: Some(new.spec),
        owner: new.owner,
        ..Job::default()
    })
}

/// The caller's id of a request, for the log, in which it leads from the caller to the job. A long one is cut.
fn id_of(request: &Option<RequestKey>) -> String {
    let id = request.as_ref().map(|it| it.request_id.as_str());
    one_line(id.unwrap_or_default(), REQUEST_ID_BYTES)
}

/// Checks an order without the catalogue.
///
/// # Errors
/// With all faults of its fields.
pub(crate) fn check_order(spec: &JobSpec) -> Result<(), RequestError> {
    let faults = checks::job(spec).into_iter();
    let faults = faults.map(|it| Err(RequestError::invalid(path(&it.field), it.message)));
    all::<()>(faults).map(drop)
}

/// The path of the order's `field` in the request.
fn path(field: &str) -> String {
    match field {
        "" => "spec".into(),
        field => format!("spec.{field}"),
    }
}

/// Cancels a job: a queued one at once, a running one through its worker.
///
/// # Errors
/// When the job does not exist.
pub(crate) async fn cancel(
    context: &Context,
    tenant: &Tenant,
    id: &str,
    request: Option<RequestKey>,
) -> Result<Job, RequestError> {
    let request_id = id_of(&request);
    let job = context.store.cancel_job(tenant, id, request).await?;
    context.notifier.announce_end(&job.name);
    tracing::info!(
        job = job.name,
        state = job.state().as_str_name(),
        request_id,
        "job cancel requested"
    );
    Ok(job)
}
