//! `yoto.v1.ModelService`.

use super::{fields, paging};
use crate::{context::Context, error::RequestError, store::NewModel};
use futures::TryStreamExt;
use std::sync::Arc;
use tonic::{Request, Response, Status};
use yoto_proto::{
    names::{self, Collection},
    tiers,
    v1::{
        AddIdentityRequest, CreateModelRequest, GetModelRequest, GetTradeoffRequest, IdentitySlot,
        ListCheckpointsRequest, ListCheckpointsResponse, ListModelsRequest, ListModelsResponse,
        Model, Tradeoff, model_service_server::ModelService,
    },
};

/// Shared networks and the identity slots inside them.
pub struct ModelApi {
    /// The shared parts.
    pub context: Arc<Context>,
}

#[tonic::async_trait]
impl ModelService for ModelApi {
    async fn create_model(
        &self,
        request: Request<CreateModelRequest>,
    ) -> Result<Response<Model>, Status> {
        let request = request.into_inner();
        let key = fields::request_key("CreateModel", &request.request_id, &request)?;
        if !tiers::is_tier(&request.tier) {
            let message = format!("the tiers are {}", tiers::listed(tiers::TIERS));
            return Err(RequestError::invalid("tier", message).into());
        }
        if !tiers::is_variant(&request.variant) {
            let message = format!("the variants are {}", tiers::listed(tiers::VARIANTS));
            return Err(RequestError::invalid("variant", message).into());
        }
        let new = NewModel {
            display_name: fields::display_name(&request.display_name)?,
            tier: request.tier,
            variant: request.variant,
        };
        let model = self.context.store.create_model(new, key).await;
        Ok(Response::new(model.map_err(RequestError::from)?))
    }

    async fn get_model(
        &self,
        request: Request<GetModelRequest>,
    ) -> Result<Response<Model>, Status> {
        let id = fields::id(Collection::Models, "name", &request.get_ref().name)?;
        let model = self.context.store.model(&id).await;
        Ok(Response::new(model.map_err(RequestError::from)?))
    }

    async fn list_models(
        &self,
        request: Request<ListModelsRequest>,
    ) -> Result<Response<ListModelsResponse>, Status> {
        let request = request.get_ref();
        let page = paging::Request::read("models", request.page_size, &request.page_token)?;
        let entries = self.context.store.models(page.page()).await;
        let (models, next_page_token) = page.cut(entries.map_err(RequestError::from)?);
        Ok(Response::new(ListModelsResponse {
            models,
            next_page_token,
        }))
    }

    async fn add_identity(
        &self,
        request: Request<AddIdentityRequest>,
    ) -> Result<Response<IdentitySlot>, Status> {
        let request = request.get_ref();
        let model = fields::id(Collection::Models, "model", &request.model)?;
        let subject = fields::id(Collection::Subjects, "subject", &request.subject)?;
        let slot = self.context.store.add_identity(&model, &subject).await;
        Ok(Response::new(slot.map_err(RequestError::from)?))
    }

    async fn list_checkpoints(
        &self,
        request: Request<ListCheckpointsRequest>,
    ) -> Result<Response<ListCheckpointsResponse>, Status> {
        let model = fields::id(Collection::Models, "model", &request.get_ref().model)?;
        let checkpoints = self.context.store.checkpoints(&model, u32::MAX).await;
        let checkpoints = checkpoints.map_err(RequestError::from)?;
        Ok(Response::new(ListCheckpointsResponse { checkpoints }))
    }

    async fn get_tradeoff(
        &self,
        request: Request<GetTradeoffRequest>,
    ) -> Result<Response<Tradeoff>, Status> {
        let name = &request.get_ref().checkpoint;
        let (model, _) = names::parse_checkpoint(name)
            .map_err(|error| RequestError::invalid("checkpoint", error.to_string()))?;
        let checkpoints = self.context.store.checkpoints(model, u32::MAX).await;
        let checkpoints = checkpoints.map_err(RequestError::from)?;
        let object = checkpoints
            .into_iter()
            .find(|it| it.name == *name)
            .and_then(|it| it.tradeoff)
            .ok_or_else(|| RequestError::NotFound {
                name: format!("a measured trade-off of {name}"),
            })?;
        let bytes = self.context.objects.get(&object).await;
        let parts: Vec<_> = bytes
            .map_err(RequestError::from)?
            .try_collect()
            .await
            .map_err(RequestError::from)?;
        Ok(Response::new(Tradeoff {
            checkpoint: name.clone(),
            json: parts.concat(),
        }))
    }
}
