//! Orders of jobs: what `CreateJob` and `CreateRender` do.

use super::{fields, public};
use crate::context::Context;
use crate::jobs::queue;
use yoto_proto::v1::{Job, JobSpec};
use yoto_request::RequestError;
use yoto_request::validation::both;
use yoto_store::{NewJob, RequestKey, Tenant, TraceParent};

/// A job as a call orders it.
pub(super) struct Order {
    /// The request's id and the digest of its message, if it has an id.
    pub key: Result<Option<RequestKey>, RequestError>,
    /// What is to be done.
    pub spec: JobSpec,
    /// Number of the priority, as in the contract.
    pub priority: i32,
    /// Who the job is for.
    pub owner: String,
    /// Whether the order is checked and not carried out.
    pub validate_only: bool,
    /// The caller's span.
    pub trace_parent: Option<TraceParent>,
}

/// Checks the order, and queues its job unless it is only to be checked.
///
/// # Errors
/// With all faults of the request's fields; when the catalogue can't serve the order.
pub(super) async fn order_job(
    context: &Context,
    tenant: &Tenant,
    order: Order,
) -> Result<Job, RequestError> {
    let new = fields::new_job(order.spec, order.priority, &order.owner);
    let (key, new) = both(order.key, new)?;
    if order.validate_only {
        let job = queue::validate(context, tenant, new).await?;
        return Ok(Job {
            priority: order.priority,
            ..job
        });
    }
    let new = NewJob {
        trace_parent: order.trace_parent,
        ..new
    };
    Ok(public::job(queue::create(context, tenant, new, key).await?))
}
