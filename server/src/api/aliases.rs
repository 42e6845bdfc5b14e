//! Names that people give checkpoints, in calls: `models/{id}/checkpoints/prod`.

use super::fields;
use super::models::ModelApi;
use crate::context::Context;
use crate::error::RequestError;
use crate::tenant::Tenant;
use yoto_proto::alias;
use yoto_proto::names::{self, Collection};
use yoto_proto::v1::{Checkpoint, JobSpec, RemoveAliasRequest, SetAliasRequest, job_spec};

/// `SetAlias`.
pub async fn set(
    api: &ModelApi,
    tenant: &Tenant,
    request: &SetAliasRequest,
) -> Result<Checkpoint, RequestError> {
    if !alias::is_alias(&request.alias) {
        return Err(RequestError::invalid("alias", alias::RULE));
    }
    let found = checkpoint(api, tenant, "checkpoint", &request.checkpoint).await?;
    let (model, step) = names::parse_checkpoint(&found.name)
        .map_err(|error| RequestError::invalid("checkpoint", error.to_string()))?;
    let store = &api.context.store;
    store.set_alias(tenant, model, step, &request.alias).await?;
    let (name, alias) = (&found.name, &request.alias);
    tracing::info!(checkpoint = name, alias, "a checkpoint was named");
    checkpoint(api, tenant, "checkpoint", name).await
}

/// `RemoveAlias`.
pub async fn remove(
    context: &Context,
    tenant: &Tenant,
    request: &RemoveAliasRequest,
) -> Result<(), RequestError> {
    let id = fields::id(Collection::Models, "model", &request.model)?;
    context
        .store
        .remove_alias(tenant, &id, &request.alias)
        .await?;
    Ok(())
}

/// The checkpoint called `name` in this field, by its step or an alias.
pub async fn checkpoint(
    api: &ModelApi,
    tenant: &Tenant,
    field: &str,
    name: &str,
) -> Result<Checkpoint, RequestError> {
    let called = alias::of_checkpoint(name);
    let model = match called {
        Some((model, _)) => model,
        None => {
            let parsed = names::parse_checkpoint(name);
            parsed
                .map_err(|error| RequestError::invalid(field, error.to_string()))?
                .0
        }
    };
    let checkpoints = api.explained(tenant, model).await?;
    let is_called = |it: &Checkpoint| match called {
        Some((_, alias)) => it.aliases.iter().any(|own| own == alias),
        None => it.name == name,
    };
    let missing = || RequestError::NotFound {
        name: name.to_owned(),
    };
    checkpoints.into_iter().find(is_called).ok_or_else(missing)
}

/// Replaces an alias in an order by the checkpoint that has it now: what is rendered does not change with a later move of the alias.
///
/// # Errors
/// When no checkpoint of the model is called so.
pub async fn resolve(
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
