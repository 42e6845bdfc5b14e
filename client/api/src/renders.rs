//! Renders: requests for pictures.

use super::retry::repeat;
use super::{ClientError, YotoClient, request_id};
use yoto_proto::key::Connection;
use yoto_proto::limits::{ANSWER_BYTES, MESSAGE_BYTES};
use yoto_proto::v1::render_service_client::RenderServiceClient;
use yoto_proto::v1::{CreateRenderRequest, Job, RenderSpec};

impl YotoClient {
    fn render_service(&self) -> RenderServiceClient<Connection> {
        RenderServiceClient::new(self.channel.clone())
            .max_decoding_message_size(ANSWER_BYTES)
            .max_encoding_message_size(MESSAGE_BYTES)
    }

    /// Queues a render.
    ///
    /// # Errors
    /// [`ClientError::Refused`], e.g. for a model without a checkpoint.
    pub async fn create_render(&self, spec: RenderSpec) -> Result<Job, ClientError> {
        let request = CreateRenderRequest {
            spec: Some(spec),
            request_id: request_id(),
            priority: self.queue.priority.into(),
            owner: self.queue.owner.clone(),
            validate_only: false,
        };
        let create = || {
            let (mut service, request) = (self.render_service(), request.clone());
            async move { service.create_render(request).await }
        };
        let created = repeat(create).await;
        created.map_err(ClientError::refused("creating a render"))
    }
}
