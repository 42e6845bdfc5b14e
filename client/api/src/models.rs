//! Models: shared networks, and the identity slots of the people in them.

use super::retry::{read, repeat};
use super::{ClientError, YotoClient, request_id};
use prost_types::FieldMask;
use yoto_proto::key::Connection;
use yoto_proto::pose_track::{PoseTrack, describe};
use yoto_proto::v1::model_service_client::ModelServiceClient;
use yoto_proto::v1::{
    AddIdentityRequest, Checkpoint, CreateModelRequest, DeleteCheckpointRequest,
    DeleteModelRequest, Deleted, GetCheckpointRequest, GetModelRequest, GetRefinedPosesRequest,
    GetTradeoffRequest, IdentitySlot, ListCheckpointsRequest, ListModelsRequest, Model,
    RemoveAliasRequest, RemoveIdentityRequest, Retention, SetAliasRequest, UpdateModelRequest,
};

impl YotoClient {
    fn model_service(&self) -> ModelServiceClient<Connection> {
        ModelServiceClient::new(self.channel.clone())
    }

    /// Creates an untrained model of a quality tier and variant
    /// (see [`yoto_proto::tiers`]).
    ///
    /// # Errors
    /// [`ClientError::Refused`], e.g. for an unknown tier.
    pub async fn create_model(
        &self,
        display_name: &str,
        tier: &str,
        variant: &str,
    ) -> Result<Model, ClientError> {
        let request = CreateModelRequest {
            display_name: display_name.to_owned(),
            tier: tier.to_owned(),
            variant: variant.to_owned(),
            request_id: request_id(),
            retention: None,
            validate_only: false,
        };
        let create = || {
            let (mut service, request) = (self.model_service(), request.clone());
            async move { service.create_model(request).await }
        };
        let doing = format!("creating the model '{display_name}'");
        repeat(create).await.map_err(ClientError::refused(doing))
    }

    /// The model `name` with its slots.
    ///
    /// # Errors
    /// [`ClientError::Refused`] when no model has this name.
    pub async fn get_model(&self, name: &str) -> Result<Model, ClientError> {
        let get = || {
            let (mut service, name) = (self.model_service(), name.to_owned());
            async move { service.get_model(GetModelRequest { name }).await }
        };
        let found = read(get).await;
        found.map_err(ClientError::refused(format!("reading {name}")))
    }

    /// Every model, over all pages.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn list_models(&self) -> Result<Vec<Model>, ClientError> {
        let service = self.model_service();
        let (mut models, mut page_token) = (Vec::new(), String::new());
        loop {
            let request = ListModelsRequest {
                page_size: 1000,
                page_token,
            };
            let list = || {
                let (mut service, request) = (service.clone(), request.clone());
                async move { service.list_models(request).await }
            };
            let page = read(list).await;
            let page = page.map_err(ClientError::refused("listing models"))?;
            models.extend(page.models);
            page_token = page.next_page_token;
            if page_token.is_empty() {
                return Ok(models);
            }
        }
    }

    /// Gives a READY subject the model's next identity slot.
    ///
    /// # Errors
    /// [`ClientError::Refused`], e.g. while the subject's capture is still being ingested.
    pub async fn add_identity(
        &self,
        model: &str,
        subject: &str,
    ) -> Result<IdentitySlot, ClientError> {
        let request = AddIdentityRequest {
            model: model.to_owned(),
            subject: subject.to_owned(),
            request_id: request_id(),
        };
        let add = || {
            let (mut service, request) = (self.model_service(), request.clone());
            async move { service.add_identity(request).await }
        };
        let doing = format!("giving {subject} a slot in {model}");
        repeat(add).await.map_err(ClientError::refused(doing))
    }

    /// Removes a subject's slot that no checkpoint was trained with.
    ///
    /// # Errors
    /// [`ClientError::Refused`], e.g. once the model was trained with them.
    pub async fn remove_identity(&self, model: &str, subject: &str) -> Result<Model, ClientError> {
        let request = RemoveIdentityRequest {
            model: model.to_owned(),
            subject: subject.to_owned(),
            request_id: request_id(),
        };
        let remove = || {
            let (mut service, request) = (self.model_service(), request.clone());
            async move { service.remove_identity(request).await }
        };
        let doing = format!("removing {subject} from {model}");
        repeat(remove).await.map_err(ClientError::refused(doing))
    }

    /// The model's checkpoints, newest first.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn list_checkpoints(&self, model: &str) -> Result<Vec<Checkpoint>, ClientError> {
        let (mut checkpoints, mut page_token) = (Vec::new(), String::new());
        loop {
            let request = ListCheckpointsRequest {
                model: model.to_owned(),
                page_size: 1000,
                page_token,
            };
            let list = || {
                let (mut service, request) = (self.model_service(), request.clone());
                async move { service.list_checkpoints(request).await }
            };
            let doing = format!("listing checkpoints of {model}");
            let page = read(list).await.map_err(ClientError::refused(doing))?;
            checkpoints.extend(page.checkpoints);
            page_token = page.next_page_token;
            if page_token.is_empty() {
                return Ok(checkpoints);
            }
        }
    }

    /// Name of the best checkpoint of `model` by held-out PSNR.
    ///
    /// # Errors
    /// [`ClientError::NoCheckpoint`] if the model has none yet; [`ClientError::Refused`].
    pub async fn checkpoint_name(&self, model: &Model) -> Result<String, ClientError> {
        let all = self.list_checkpoints(&model.name).await?;
        let best = all.into_iter().find(|checkpoint| checkpoint.best);
        let missing = || ClientError::NoCheckpoint(model.display_name.clone());
        Ok(best.ok_or_else(missing)?.name)
    }

    /// The pose track of `subject` (`subjects/{id}`) as the training of the best checkpoint of `model`
    /// (`models/{id}`) has refined it.
    ///
    /// # Errors
    /// [`ClientError::Refused`], e.g. when their poses are not refined; [`ClientError::Contract`] when
    /// the answer is not a pose track.
    pub async fn refined_poses(
        &self,
        model: &str,
        subject: &str,
    ) -> Result<PoseTrack, ClientError> {
        let doing = format!("fetching the refined poses of {subject} in {model}");
        let request = GetRefinedPosesRequest {
            model: model.to_owned(),
            subject: subject.to_owned(),
        };
        let answer = self.model_service().get_refined_poses(request).await;
        let mut stream = answer.map_err(ClientError::refused(&doing))?.into_inner();
        let mut bytes = Vec::new();
        while let Some(part) = (stream.message().await).map_err(ClientError::refused(&doing))? {
            bytes.extend_from_slice(&part.chunk);
        }
        PoseTrack::from_binary(&bytes).map_err(|found| {
            let found: Vec<String> = found.iter().map(describe).collect();
            ClientError::Contract(format!("{doing}: {}", found.join("; ")))
        })
    }

    /// The measured trade-off of time and fidelity of `checkpoint`
    /// (`models/{id}/checkpoints/{step}`), as JSON.
    ///
    /// # Errors
    /// [`ClientError::Refused`] when it was not measured.
    pub async fn get_tradeoff(&self, checkpoint: &str) -> Result<Vec<u8>, ClientError> {
        let request = GetTradeoffRequest {
            checkpoint: checkpoint.to_owned(),
        };
        let answer = self.model_service().get_tradeoff(request).await;
        Ok(answer
            .map_err(ClientError::refused(format!(
                "reading the trade-off of {checkpoint}"
            )))?
            .into_inner()
            .json)
    }

    /// Changes which checkpoints a model keeps; the others are removed at once.
    ///
    /// # Errors
    /// [`ClientError::Refused`], e.g. for a retention that keeps none.
    pub async fn set_retention(
        &self,
        model: &str,
        retention: Retention,
    ) -> Result<Model, ClientError> {
        let request = UpdateModelRequest {
            model: Some(Model {
                name: model.to_owned(),
                retention: Some(retention),
                ..Model::default()
            }),
            update_mask: Some(FieldMask {
                paths: vec!["retention".to_owned()],
            }),
        };
        let update = || {
            let (mut service, request) = (self.model_service(), request.clone());
            async move { service.update_model(request).await }
        };
        let doing = format!("changing what {model} keeps");
        repeat(update).await.map_err(ClientError::refused(doing))
    }

    /// The checkpoint `name`, "models/{id}/checkpoints/{step}" or with an alias in place of the step.
    ///
    /// # Errors
    /// [`ClientError::Refused`], e.g. when there is none.
    pub async fn get_checkpoint(&self, name: &str) -> Result<Checkpoint, ClientError> {
        let get = || {
            let mut service = self.model_service();
            let name = name.to_owned();
            async move { service.get_checkpoint(GetCheckpointRequest { name }).await }
        };
        let doing = format!("reading {name}");
        read(get).await.map_err(ClientError::refused(doing))
    }

    /// Gives the `checkpoint` an alias, which another one of its model may lose.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn set_alias(
        &self,
        checkpoint: &str,
        alias: &str,
    ) -> Result<Checkpoint, ClientError> {
        let request = SetAliasRequest {
            checkpoint: checkpoint.to_owned(),
            alias: alias.to_owned(),
        };
        let set = || {
            let (mut service, request) = (self.model_service(), request.clone());
            async move { service.set_alias(request).await }
        };
        let doing = format!("naming {checkpoint}");
        repeat(set).await.map_err(ClientError::refused(doing))
    }

    /// Takes an alias of a checkpoint of the `model`, "models/{id}", away.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn remove_alias(&self, model: &str, alias: &str) -> Result<(), ClientError> {
        let request = RemoveAliasRequest {
            model: model.to_owned(),
            alias: alias.to_owned(),
        };
        let remove = || {
            let (mut service, request) = (self.model_service(), request.clone());
            async move { service.remove_alias(request).await }
        };
        let doing = format!("removing the alias {alias}");
        repeat(remove)
            .await
            .map_err(ClientError::refused(doing))
            .map(drop)
    }

    /// Deletes a model with its checkpoints and jobs, if its version is still `etag`; an empty `etag`
    /// accepts any version.
    ///
    /// # Errors
    /// [`ClientError::Refused`], e.g. while a job of it is queued or running.
    pub async fn delete_model(&self, name: &str, etag: &str) -> Result<Deleted, ClientError> {
        let request = DeleteModelRequest {
            name: name.to_owned(),
            request_id: request_id(),
            etag: etag.to_owned(),
        };
        let delete = || {
            let (mut service, request) = (self.model_service(), request.clone());
            async move { service.delete_model(request).await }
        };
        let doing = format!("deleting {name}");
        repeat(delete).await.map_err(ClientError::refused(doing))
    }

    /// Deletes the checkpoint `name` (`models/{id}/checkpoints/{step}`), if its version is still `etag`;
    /// an empty `etag` accepts any version.
    ///
    /// # Errors
    /// [`ClientError::Refused`], e.g. while a job uses it.
    pub async fn delete_checkpoint(&self, name: &str, etag: &str) -> Result<Deleted, ClientError> {
        let request = DeleteCheckpointRequest {
            name: name.to_owned(),
            request_id: request_id(),
            etag: etag.to_owned(),
        };
        let delete = || {
            let (mut service, request) = (self.model_service(), request.clone());
            async move { service.delete_checkpoint(request).await }
        };
        let doing = format!("deleting {name}");
        repeat(delete).await.map_err(ClientError::refused(doing))
    }
}
