//! `yoto.v1.ModelService`.

use super::{aliases, fields, paging};
use crate::context::Context;
use crate::objects::manifest;
use futures::StreamExt;
use futures::stream::{self, BoxStream};
use std::sync::Arc;
use tonic::{Request, Response, Status};
use yoto_proto::limits::CHUNK_BYTES;
use yoto_proto::manifest::files;
use yoto_proto::names::{self, Collection};
use yoto_proto::tiers;
use yoto_proto::v1::model_service_server::ModelService;
use yoto_proto::v1::{
    AddIdentityRequest, Checkpoint, CreateModelRequest, DeleteCheckpointRequest,
    DeleteModelRequest, Deleted, ErrorReason, GetCheckpointRequest, GetModelRequest,
    GetRefinedPosesRequest, GetRefinedPosesResponse, GetTradeoffRequest, IdentitySlot,
    ListCheckpointsRequest, ListCheckpointsResponse, ListModelsRequest, ListModelsResponse, Model,
    ObjectRef, RemoveAliasRequest, RemoveAliasResponse, RemoveIdentityRequest, Retention,
    SetAliasRequest, Tradeoff, UpdateModelRequest,
};
use yoto_request::validation::both;
use yoto_request::{RequestError, tenant_of};
use yoto_store::rules::best::best_first;
use yoto_store::{NewModel, Target, Tenant};

/// The field of a model that can be changed.
const RETENTION: &str = "retention";

/// The checked retention: without the newest checkpoint no training could resume.
fn retention(field: &str, wanted: Option<Retention>) -> Result<Retention, RequestError> {
    let wanted = wanted.unwrap_or_default();
    if wanted.newest == Some(0) {
        let message = "a model keeps at least its newest checkpoint";
        return Err(RequestError::invalid(format!("{field}.newest"), message));
    }
    Ok(wanted)
}

/// Shared networks and the identity slots inside them.
pub(crate) struct ModelApi {
    /// The shared parts.
    pub context: Arc<Context>,
}

impl ModelApi {
    /// All checkpoints of a model as [`explained`] tells them, without manifests, whose keys contain the tokens of leases.
    pub(super) async fn explained(
        &self,
        tenant: &Tenant,
        model_id: &str,
    ) -> Result<Vec<Checkpoint>, RequestError> {
        let mut checkpoints = explained(&self.context, tenant, model_id).await?;
        for checkpoint in &mut checkpoints {
            checkpoint.manifest = None;
        }
        Ok(checkpoints)
    }
}

/// All checkpoints of a model, newest first, with the best one marked and why each is kept.
///
/// # Errors
/// When the tenant has no such model, or the database fails.
pub(crate) async fn explained(
    context: &Context,
    tenant: &Tenant,
    model_id: &str,
) -> Result<Vec<Checkpoint>, RequestError> {
    let default = context.config.storage.retention();
    let mut checkpoints = context
        .store
        .kept_checkpoints(tenant, model_id, default)
        .await?;
    let best = best_first(checkpoints.clone()).into_iter().next();
    for checkpoint in &mut checkpoints {
        checkpoint.best = best.as_ref().is_some_and(|it| it.name == checkpoint.name);
    }
    Ok(checkpoints)
}

#[tonic::async_trait]
impl ModelService for ModelApi {
    async fn create_model(
        &self,
        request: Request<CreateModelRequest>,
    ) -> Result<Response<Model>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.into_inner();
        let key = fields::request_key("CreateModel", &request.request_id, &request)?;
        let store = &self.context.store;
        // Comes before every check: a repeated request gets its first answer.
        if let Some(id) = store
            .answered(&tenant, key.as_ref().filter(|_| !request.validate_only))
            .await
            .map_err(RequestError::from)?
        {
            let model = store.model(&tenant, &id).await;
            return Ok(Response::new(model.map_err(RequestError::from)?));
        }
        let display_name = fields::display_name(&request.display_name);
        let tier = tiers::is_tier(&request.tier).then_some(()).ok_or_else(|| {
            let message = format!("the tiers are {}", tiers::listed(tiers::TIERS));
            RequestError::invalid("tier", message)
        });
        let variant = tiers::is_variant(&request.variant)
            .then_some(())
            .ok_or_else(|| {
                let message = format!("the variants are {}", tiers::listed(tiers::VARIANTS));
                RequestError::invalid("variant", message)
            });
        let retention = retention("retention", request.retention);
        let of_training = both(tier, variant);
        let ((display_name, _), retention) = both(both(display_name, of_training), retention)?;
        if request.validate_only {
            return Ok(Response::new(Model {
                display_name,
                tier: request.tier,
                variant: request.variant,
                retention: Some(retention),
                ..Model::default()
            }));
        }
        let new = NewModel {
            display_name,
            tier: request.tier,
            variant: request.variant,
            retention,
        };
        let model = self.context.store.create_model(&tenant, new, key).await;
        Ok(Response::new(model.map_err(RequestError::from)?))
    }

    async fn get_model(
        &self,
        request: Request<GetModelRequest>,
    ) -> Result<Response<Model>, Status> {
        let tenant = tenant_of(&request)?;
        let id = fields::id(Collection::Models, "name", &request.get_ref().name)?;
        let model = self.context.store.model(&tenant, &id).await;
        Ok(Response::new(model.map_err(RequestError::from)?))
    }

    async fn list_models(
        &self,
        request: Request<ListModelsRequest>,
    ) -> Result<Response<ListModelsResponse>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.get_ref();
        let page = paging::Request::read("models", request.page_size, &request.page_token, &())?;
        let entries = self.context.store.models(&tenant, page.page()).await;
        let (models, next_page_token) = page.cut(entries.map_err(RequestError::from)?);
        Ok(Response::new(ListModelsResponse {
            models,
            next_page_token,
        }))
    }

    async fn update_model(
        &self,
        request: Request<UpdateModelRequest>,
    ) -> Result<Response<Model>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.into_inner();
        let model = request.model.unwrap_or_default();
        let id = fields::id(Collection::Models, "model.name", &model.name)?;
        let paths = request.update_mask.unwrap_or_default().paths;
        if paths != [RETENTION] {
            let message = format!("only {RETENTION} can be changed, and has to be named");
            return Err(RequestError::invalid("update_mask", message).into());
        }
        let wanted = retention("model.retention", model.retention)?;
        let default = self.context.config.storage.retention();
        let model = self
            .context
            .store
            .set_retention(&tenant, &id, wanted, default, &model.etag)
            .await;
        Ok(Response::new(model.map_err(RequestError::from)?))
    }

    async fn delete_model(
        &self,
        request: Request<DeleteModelRequest>,
    ) -> Result<Response<Deleted>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.get_ref();
        let key = fields::request_key("DeleteModel", &request.request_id, request)?;
        let id = fields::id(Collection::Models, "name", &request.name)?;
        let deleted = (self.context.store)
            .delete(&tenant, Target::Model(&id), &request.etag, key)
            .await;
        Ok(Response::new(deleted.map_err(RequestError::from)?))
    }

    async fn delete_checkpoint(
        &self,
        request: Request<DeleteCheckpointRequest>,
    ) -> Result<Response<Deleted>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.get_ref();
        let key = fields::request_key("DeleteCheckpoint", &request.request_id, request)?;
        let (model, step) = names::parse_checkpoint(&request.name)
            .map_err(|error| RequestError::invalid("name", error.to_string()))?;
        let target = Target::Checkpoint { model, step };
        let deleted = (self.context.store)
            .delete(&tenant, target, &request.etag, key)
            .await;
        Ok(Response::new(deleted.map_err(RequestError::from)?))
    }

    async fn add_identity(
        &self,
        request: Request<AddIdentityRequest>,
    ) -> Result<Response<IdentitySlot>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.get_ref();
        let model = fields::id(Collection::Models, "model", &request.model)?;
        let subject = fields::id(Collection::Subjects, "subject", &request.subject)?;
        let key = fields::request_key("AddIdentity", &request.request_id, request)?;
        let slot = self
            .context
            .store
            .add_identity(&tenant, &model, &subject, key)
            .await;
        Ok(Response::new(slot.map_err(RequestError::from)?))
    }

    async fn remove_identity(
        &self,
        request: Request<RemoveIdentityRequest>,
    ) -> Result<Response<Model>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.get_ref();
        let model = fields::id(Collection::Models, "model", &request.model)?;
        let subject = fields::id(Collection::Subjects, "subject", &request.subject)?;
        let key = fields::request_key("RemoveIdentity", &request.request_id, request)?;
        let removed = self
            .context
            .store
            .remove_identity(&tenant, &model, &subject, key);
        let model = removed.await;
        Ok(Response::new(model.map_err(RequestError::from)?))
    }

    async fn list_checkpoints(
        &self,
        request: Request<ListCheckpointsRequest>,
    ) -> Result<Response<ListCheckpointsResponse>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.get_ref();
        let page = paging::Request::read(
            "checkpoints",
            request.page_size,
            &request.page_token,
            &request.model,
        )?;
        let model = fields::id(Collection::Models, "model", &request.model)?;
        let checkpoints = self.explained(&tenant, &model).await?;
        let (checkpoints, next_page_token) = page.cut(page.of_all(checkpoints));
        Ok(Response::new(ListCheckpointsResponse {
            checkpoints,
            next_page_token,
        }))
    }

    async fn get_checkpoint(
        &self,
        request: Request<GetCheckpointRequest>,
    ) -> Result<Response<Checkpoint>, Status> {
        let tenant = tenant_of(&request)?;
        let found = aliases::checkpoint(self, &tenant, "name", &request.get_ref().name);
        Ok(Response::new(found.await?))
    }

    async fn set_alias(
        &self,
        request: Request<SetAliasRequest>,
    ) -> Result<Response<Checkpoint>, Status> {
        let tenant = tenant_of(&request)?;
        let named = aliases::set(self, &tenant, request.get_ref()).await?;
        Ok(Response::new(named))
    }

    async fn remove_alias(
        &self,
        request: Request<RemoveAliasRequest>,
    ) -> Result<Response<RemoveAliasResponse>, Status> {
        let tenant = tenant_of(&request)?;
        aliases::remove(&self.context, &tenant, request.get_ref()).await?;
        Ok(Response::new(RemoveAliasResponse {}))
    }

    async fn get_tradeoff(
        &self,
        request: Request<GetTradeoffRequest>,
    ) -> Result<Response<Tradeoff>, Status> {
        let tenant = tenant_of(&request)?;
        let name = &request.get_ref().checkpoint;
        let (model, _) = names::parse_checkpoint(name)
            .map_err(|error| RequestError::invalid("checkpoint", error.to_string()))?;
        let checkpoints = self
            .context
            .store
            .checkpoints(&tenant, model, u32::MAX)
            .await;
        let checkpoints = checkpoints.map_err(RequestError::from)?;
        let object = checkpoints
            .into_iter()
            .find(|it| it.name == *name)
            .and_then(|it| it.tradeoff)
            .ok_or_else(|| RequestError::NotFound {
                name: format!("a measured trade-off of {name}"),
            })?;
        let tradeoff = self.context.objects.read(&object).await;
        Ok(Response::new(Tradeoff {
            checkpoint: name.clone(),
            json: tradeoff.map_err(RequestError::from)?.into(),
        }))
    }

    type GetRefinedPosesStream = BoxStream<'static, Result<GetRefinedPosesResponse, Status>>;

    async fn get_refined_poses(
        &self,
        request: Request<GetRefinedPosesRequest>,
    ) -> Result<Response<Self::GetRefinedPosesStream>, Status> {
        let tenant = tenant_of(&request)?;
        let GetRefinedPosesRequest { model, subject } = request.get_ref();
        let id = fields::id(Collection::Models, "model", model)?;
        let known = self.context.store.model(&tenant, &id).await;
        let slots = known.map_err(RequestError::from)?.slots;
        let missing = |what: &str| RequestError::NotFound {
            name: format!("{what} of {subject} in {model}"),
        };
        let slot = slots.iter().find(|it| it.subject == *subject);
        let slot = slot.ok_or_else(|| missing("a slot"))?;
        let all = self.context.store.checkpoints(&tenant, &id, u32::MAX).await;
        let file = files::refined_poses(slot.slot as usize);
        let checkpoints = best_first(all.map_err(RequestError::from)?);
        let found = self.first_whole(checkpoints, &file).await?;
        let bytes = found
            .ok_or_else(|| missing("a checkpoint"))?
            .ok_or_else(|| missing("refined poses"))?;
        let chunks: Vec<_> = bytes
            .chunks(CHUNK_BYTES)
            .map(|chunk| {
                Ok(GetRefinedPosesResponse {
                    chunk: chunk.to_vec(),
                })
            })
            .collect();
        Ok(Response::new(stream::iter(chunks).boxed()))
    }
}

impl ModelApi {
    /// Reads `file` of the first undamaged checkpoint. The inner option is `None` if that checkpoint has no
    /// such file, the outer one if there is no checkpoint.
    ///
    /// # Errors
    /// The error of the last checkpoint when all are damaged; another error when the store fails.
    async fn first_whole(
        &self,
        checkpoints: Vec<Checkpoint>,
        file: &str,
    ) -> Result<Option<Option<Vec<u8>>>, RequestError> {
        let mut last = None;
        for checkpoint in checkpoints {
            match self.file(&checkpoint, file).await {
                Ok(bytes) => return Ok(Some(bytes)),
                Err(RequestError::Objects(error)) if !error.is_torn() => {
                    return Err(error.into());
                }
                Err(error) => {
                    let name = checkpoint.name;
                    tracing::warn!(checkpoint = name, %error, "a checkpoint is torn");
                    last = Some(error);
                }
            }
        }
        last.map_or(Ok(None), Err)
    }

    /// A file of a checkpoint; `None` if it has no such file.
    async fn file(
        &self,
        checkpoint: &Checkpoint,
        file: &str,
    ) -> Result<Option<Vec<u8>>, RequestError> {
        let torn =
            |message: String| RequestError::precondition(ErrorReason::CheckpointTorn, message);
        let manifest = checkpoint.manifest.as_ref();
        let manifest = manifest.ok_or_else(|| torn("it has no manifest".into()))?;
        let manifest = manifest::read(&self.context, manifest).await?;
        let Some(object) = manifest.object(file) else {
            return Ok(None);
        };
        let object = ObjectRef {
            key: object.key.clone(),
            bytes: object.bytes,
            sha256: object.sha256.clone(),
        };
        Ok(Some(self.context.objects.read(&object).await?.into()))
    }
}
