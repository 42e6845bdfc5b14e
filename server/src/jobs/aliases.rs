//! Aliases of checkpoints in orders: `models/{id}/checkpoints/prod`.

use crate::context::Context;
use yoto_proto::v1::{JobSpec, job_spec};
use yoto_proto::{alias, names};
use yoto_request::RequestError;
use yoto_store::Tenant;

/// Replaces an alias in an order by the checkpoint that has it now: what is rendered does not change with a later move of the alias.
///
/// # Errors
/// When no checkpoint of the model is called so.
pub(super) async fn resolve(
    context: &Context,
    tenant: &Tenant,
    spec: &mut JobSpec,
) -> Result<(), RequestError> {
    let named = match &mut spec.kind {
        Some(job_spec::Kind::Render(it)) => &mut it.checkpoint,
        Some(job_spec::Kind::Evaluate(it)) => &mut it.checkpoint,
        Some(job_spec::Kind::Export(it)) => &mut it.checkpoint,
        _ => return Ok(()),
    };
    if let Some((model, alias)) = alias::of_checkpoint(named) {
        let step = context.store.step_of_alias(tenant, model, alias).await?;
        let step = step.ok_or_else(|| RequestError::NotFound {
            name: named.clone(),
        })?;
        *named = names::checkpoint(&format!("models/{model}"), step);
    }
    Ok(())
}
