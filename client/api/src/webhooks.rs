//! Addresses that are told when jobs end.

use super::retry::{read, repeat};
use super::{ClientError, YotoClient};
use yoto_proto::v1::webhook_service_client::WebhookServiceClient;
use yoto_proto::v1::{
    CreateWebhookRequest, CreateWebhookResponse, DeleteWebhookRequest, ListWebhooksRequest, Webhook,
};

impl YotoClient {
    /// Adds an address. The answer alone has the secret of its signatures.
    ///
    /// # Errors
    /// [`ClientError::Refused`]. A call whose answer is lost is not repeated, and leaves an address whose secret nobody has.
    pub async fn create_webhook(
        &self,
        url: &str,
        note: &str,
    ) -> Result<CreateWebhookResponse, ClientError> {
        let mut service = WebhookServiceClient::new(self.channel.clone());
        let request = CreateWebhookRequest {
            url: url.to_owned(),
            note: note.to_owned(),
        };
        let created = service.create_webhook(request).await;
        let created = created.map_err(ClientError::refused("adding a webhook"))?;
        Ok(created.into_inner())
    }

    /// All addresses of the caller's tenant, newest first.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn list_webhooks(&self) -> Result<Vec<Webhook>, ClientError> {
        let list = || {
            let mut service = WebhookServiceClient::new(self.channel.clone());
            async move { service.list_webhooks(ListWebhooksRequest {}).await }
        };
        let listed = read(list).await;
        Ok(listed
            .map_err(ClientError::refused("listing webhooks"))?
            .webhooks)
    }

    /// Removes an address, by its resource name.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn delete_webhook(&self, name: &str) -> Result<(), ClientError> {
        let delete = || {
            let mut service = WebhookServiceClient::new(self.channel.clone());
            let name = name.to_owned();
            async move { service.delete_webhook(DeleteWebhookRequest { name }).await }
        };
        let deleted = repeat(delete).await;
        deleted
            .map_err(ClientError::refused("removing a webhook"))
            .map(drop)
    }
}
