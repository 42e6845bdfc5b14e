//! Garbage collection of the service's store, and its status.

use super::{ClientError, YotoClient};
use yoto_proto::v1::storage_service_client::StorageServiceClient;
use yoto_proto::v1::{CollectGarbageRequest, CollectGarbageResponse};

impl YotoClient {
    /// Finds the objects that nothing refers to, and removes those whose time of grace is over. With
    /// `now`, objects of deleted resources are removed at once; with `dry_run`, none are removed.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn collect_garbage(
        &self,
        dry_run: bool,
        now: bool,
    ) -> Result<CollectGarbageResponse, ClientError> {
        let mut service = StorageServiceClient::new(self.channel.clone());
        let request = CollectGarbageRequest { dry_run, now };
        let answer = service.collect_garbage(request).await;
        let doing = "collecting garbage";
        Ok(answer.map_err(ClientError::refused(doing))?.into_inner())
    }
}
