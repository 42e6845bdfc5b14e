//! Renders: requests for pictures.

use super::{ClientError, MAX_MESSAGE, YotoClient, request_id};
use yoto_proto::v1::render_service_client::RenderServiceClient;
use yoto_proto::v1::{CreateRenderRequest, Job, RenderSpec};

impl YotoClient {
    fn render_service(&self) -> RenderServiceClient<tonic::transport::Channel> {
        RenderServiceClient::new(self.channel.clone())
            .max_decoding_message_size(MAX_MESSAGE)
            .max_encoding_message_size(MAX_MESSAGE)
    }

    /// Queues a render.
    ///
    /// # Errors
    /// [`ClientError::Refused`], e.g. for a model without a checkpoint.
    pub async fn create_render(&self, spec: RenderSpec) -> Result<Job, ClientError> {
        let request = CreateRenderRequest {
            spec: Some(spec),
            request_id: request_id(),
            priority: self.turn.priority.into(),
            owner: self.turn.owner.clone(),
        };
        Ok(self
            .render_service()
            .create_render(request)
            .await
            .map_err(ClientError::refused("creating a render"))?
            .into_inner())
    }
}
