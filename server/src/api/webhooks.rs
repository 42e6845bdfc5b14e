//! `yoto.v1.WebhookService`.

use super::fields;
use crate::context::Context;
use crate::webhooks::{check_url, new_secret};
use std::sync::Arc;
use tonic::{Request, Response, Status};
use yoto_proto::limits::OWNER_CHARACTERS;
use yoto_proto::names::Collection;
use yoto_proto::v1::webhook_service_server::WebhookService;
use yoto_proto::v1::{
    CreateWebhookRequest, CreateWebhookResponse, DeleteWebhookRequest, DeleteWebhookResponse,
    ListWebhooksRequest, ListWebhooksResponse,
};
use yoto_request::validation::both;
use yoto_request::{RequestError, tenant_of};
use yoto_store::NewWebhook;

/// Addresses that are told when jobs end.
pub(crate) struct WebhookApi {
    /// The shared parts.
    pub context: Arc<Context>,
}

#[tonic::async_trait]
impl WebhookService for WebhookApi {
    async fn create_webhook(
        &self,
        request: Request<CreateWebhookRequest>,
    ) -> Result<Response<CreateWebhookResponse>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.into_inner();
        let url = check_url(&request.url, self.context.config.private_webhooks);
        let url = url.map_err(|error| RequestError::invalid("url", error.to_string()));
        let note = fields::line("note", &request.note, OWNER_CHARACTERS);
        let (url, note) = both(url, note)?;
        let secret =
            new_secret().map_err(|_| Status::internal("the system has no random bytes"))?;
        let new = NewWebhook {
            url: url.into(),
            secret: secret.clone(),
            note,
        };
        let webhook = self.context.store.create_webhook(&tenant, &new).await;
        let webhook = webhook.map_err(RequestError::from)?;
        tracing::info!(webhook = webhook.name, "a webhook was added");
        Ok(Response::new(CreateWebhookResponse {
            webhook: Some(webhook),
            secret,
        }))
    }

    async fn list_webhooks(
        &self,
        request: Request<ListWebhooksRequest>,
    ) -> Result<Response<ListWebhooksResponse>, Status> {
        let webhooks = self.context.store.webhooks(&tenant_of(&request)?).await;
        Ok(Response::new(ListWebhooksResponse {
            webhooks: webhooks.map_err(RequestError::from)?,
        }))
    }

    async fn delete_webhook(
        &self,
        request: Request<DeleteWebhookRequest>,
    ) -> Result<Response<DeleteWebhookResponse>, Status> {
        let tenant = tenant_of(&request)?;
        let id = fields::id(Collection::Webhooks, "name", &request.get_ref().name)?;
        let deleted = self.context.store.delete_webhook(&tenant, &id).await;
        deleted.map_err(RequestError::from)?;
        tracing::info!(webhook = request.get_ref().name, "a webhook was removed");
        Ok(Response::new(DeleteWebhookResponse {}))
    }
}
