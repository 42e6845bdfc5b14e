//! Names that people give checkpoints, in calls: `models/{id}/checkpoints/prod`.

use super::fields;
use super::models::ModelApi;
use crate::context::Context;
use yoto_proto::alias;
use yoto_proto::names::{self, Collection};
use yoto_proto::v1::{Checkpoint, RemoveAliasRequest, SetAliasRequest};
use yoto_request::RequestError;
use yoto_store::Tenant;

/// `SetAlias`.
pub(super) async fn set(
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
pub(super) async fn remove(
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
pub(super) async fn checkpoint(
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
