//! The state of the service as a whole.

use super::{ClientError, YotoClient};
use yoto_proto::v1::status_service_client::StatusServiceClient;
use yoto_proto::v1::{GetStatusRequest, ServiceStatus};

impl YotoClient {
    /// Version, workers, queue and storage of the service.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn status(&self) -> Result<ServiceStatus, ClientError> {
        let mut service = StatusServiceClient::new(self.channel.clone());
        let answer = service.get_status(GetStatusRequest {}).await;
        let doing = "reading the status of the service";
        Ok(answer.map_err(ClientError::refused(doing))?.into_inner())
    }
}
