//! The state of the service as a whole.

use super::retry::{read, repeat};
use super::{ClientError, YotoClient};
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_check_response::ServingStatus;
use tonic_health::pb::health_client::HealthClient;
use yoto_proto::v1::status_service_client::StatusServiceClient;
use yoto_proto::v1::{
    CordonWorkerRequest, DrainRequest, EndDrainRequest, GetLimitsRequest, GetStatusRequest,
    ServiceLimits, ServiceStatus, UncordonWorkerRequest,
};

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

    /// Whether the service can serve: it can write its rows, its objects are there, and it is not about to end. No key is asked
    /// for.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn is_ready(&self) -> Result<bool, ClientError> {
        let check = || {
            let mut health = HealthClient::new(self.channel.clone());
            async move { health.check(HealthCheckRequest::default()).await }
        };
        let checked = read(check).await;
        let checked = checked.map_err(ClientError::refused("asking for the service's health"))?;
        Ok(checked.status() == ServingStatus::Serving)
    }

    /// Version, workers, queue and storage of the service.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn status(&self) -> Result<ServiceStatus, ClientError> {
        let get = || {
            let mut service = StatusServiceClient::new(self.channel.clone());
            async move { service.get_status(GetStatusRequest {}).await }
        };
        let doing = "reading the status of the service";
        read(get).await.map_err(ClientError::refused(doing))
    }

    /// The service takes no new jobs and gives no leases, for a reason; running jobs continue.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn drain(&self, reason: &str) -> Result<(), ClientError> {
        let drain = || {
            let mut service = StatusServiceClient::new(self.channel.clone());
            let reason = reason.to_owned();
            async move { service.drain(DrainRequest { reason }).await }
        };
        let drained = repeat(drain).await.map(drop);
        drained.map_err(ClientError::refused("draining the service"))
    }

    /// The service takes jobs and gives leases again.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn end_drain(&self) -> Result<(), ClientError> {
        let end = || {
            let mut service = StatusServiceClient::new(self.channel.clone());
            async move { service.end_drain(EndDrainRequest {}).await }
        };
        let ended = repeat(end).await.map(drop);
        ended.map_err(ClientError::refused("ending the drain of the service"))
    }

    /// Workers with this display name get no leases, for a reason; their running jobs continue.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn cordon(&self, display_name: &str, reason: &str) -> Result<(), ClientError> {
        let request = CordonWorkerRequest {
            display_name: display_name.to_owned(),
            reason: reason.to_owned(),
        };
        let cordon = || {
            let mut service = StatusServiceClient::new(self.channel.clone());
            let request = request.clone();
            async move { service.cordon_worker(request).await }
        };
        let cordoned = repeat(cordon).await.map(drop);
        cordoned.map_err(ClientError::refused("cordoning a worker"))
    }

    /// Workers with this display name get leases again.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn uncordon(&self, display_name: &str) -> Result<(), ClientError> {
        let uncordon = || {
            let mut service = StatusServiceClient::new(self.channel.clone());
            let display_name = display_name.to_owned();
            async move {
                let request = UncordonWorkerRequest { display_name };
                service.uncordon_worker(request).await
            }
        };
        let uncordoned = repeat(uncordon).await.map(drop);
        uncordoned.map_err(ClientError::refused("uncordoning a worker"))
    }
}
