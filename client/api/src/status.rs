//! The state of the service as a whole.

use super::{ClientError, YotoClient, retry::repeat};
use yoto_proto::v1::status_service_client::StatusServiceClient;
use yoto_proto::v1::{GetLimitsRequest, GetStatusRequest, ServiceLimits, ServiceStatus};

impl YotoClient {
    /// What the service allows: sizes and numbers.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn limits(&self) -> Result<ServiceLimits, ClientError> {
        let read = || {
            let mut service = StatusServiceClient::new(self.channel.clone());
            async move { service.get_limits(GetLimitsRequest {}).await }
        };
        let doing = "reading the limits of the service";
        repeat(read).await.map_err(ClientError::refused(doing))
    }

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
