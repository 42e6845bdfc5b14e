//! Orders of jobs that ended without success, queued again.

use super::queue;
use crate::context::Context;
use crate::uploads;
use yoto_proto::names::Collection;
use yoto_proto::v1::{Capture, ErrorReason, Job, JobKind, job};
use yoto_request::RequestError;
use yoto_store::{NewJob, RequestKey, StoreError, Tenant, TraceParent};

/// Queues the order of a job that FAILED or was CANCELLED as a new job. An ingest job belongs to its capture, whose files are
/// read again.
///
/// # Errors
/// When the job does not exist or is in another state, or its order can't be served any more.
pub(crate) async fn retry(
    context: &Context,
    tenant: &Tenant,
    id: &str,
    request: Option<RequestKey>,
    trace_parent: Option<TraceParent>,
) -> Result<Job, RequestError> {
    // Comes before every check, as in `queue::create`.
    if let Some(answer) = context.store.answered(tenant, request.as_ref()).await? {
        return match context.store.capture(tenant, &answer).await {
            Ok(capture) => ingest_job(context, tenant, &capture).await,
            Err(StoreError::NotFound { .. }) => Ok(context.store.job(tenant, &answer).await?),
            Err(error) => Err(error.into()),
        };
    }
    let ended = context.store.job(tenant, id).await?;
    if !ended.state().is_terminal() || ended.state() == job::State::Succeeded {
        let message = format!(
            "{} is {}: only one that FAILED or was CANCELLED is queued again",
            ended.name,
            ended.state().as_str_name()
        );
        return Err(RequestError::precondition(
            ErrorReason::NotRepeatable,
            message,
        ));
    }
    if ended.kind() == JobKind::Ingest {
        let id = Collection::Captures.parse(&ended.capture);
        let capture =
            uploads::ingest_again(context, tenant, id.unwrap_or_default(), request).await?;
        return ingest_job(context, tenant, &capture).await;
    }
    let new = NewJob {
        priority: NewJob::column(ended.priority()),
        owner: ended.owner,
        spec: ended.spec.unwrap_or_default(),
        trace_parent,
    };
    // It was accepted by an earlier version of the service, perhaps.
    queue::check_order(&new.spec)?;
    queue::create(context, tenant, new, request).await
}

/// The newest ingest job of a capture.
async fn ingest_job(
    context: &Context,
    tenant: &Tenant,
    capture: &Capture,
) -> Result<Job, RequestError> {
    let id = Collection::Jobs.parse(&capture.ingest_job);
    Ok(context.store.job(tenant, id.unwrap_or_default()).await?)
}
