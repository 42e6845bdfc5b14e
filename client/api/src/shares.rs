//! Links to pages of exports.

use super::retry::{read, repeat};
use super::{ClientError, YotoClient};
use yoto_proto::v1::share_service_client::ShareServiceClient;
use yoto_proto::v1::{
    CreateShareRequest, CreateShareResponse, ListSharesRequest, RevokeShareRequest, Share,
};

impl YotoClient {
    /// Makes a link. The answer alone has its address.
    ///
    /// # Errors
    /// [`ClientError::Refused`]. A call whose answer is lost is not repeated, and leaves a link that nobody has.
    pub async fn create_share(
        &self,
        request: CreateShareRequest,
    ) -> Result<CreateShareResponse, ClientError> {
        let mut service = ShareServiceClient::new(self.channel.clone());
        let created = service.create_share(request).await;
        let created = created.map_err(ClientError::refused("making a link"))?;
        Ok(created.into_inner())
    }

    /// All links of the caller's tenant, newest first; of one person, by resource name, unless `subject` is empty.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn list_shares(&self, subject: &str) -> Result<Vec<Share>, ClientError> {
        let mut shares = Vec::new();
        let mut page_token = String::new();
        loop {
            let request = ListSharesRequest {
                page_size: 1000,
                page_token,
                subject: subject.to_owned(),
                ..ListSharesRequest::default()
            };
            let list = || {
                let mut service = ShareServiceClient::new(self.channel.clone());
                let request = request.clone();
                async move { service.list_shares(request).await }
            };
            let page = read(list).await;
            let page = page.map_err(ClientError::refused("listing links"))?;
            shares.extend(page.shares);
            page_token = page.next_page_token;
            if page_token.is_empty() {
                return Ok(shares);
            }
        }
    }

    /// Revokes a link, by its resource name.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn revoke_share(&self, name: &str) -> Result<Share, ClientError> {
        let revoke = || {
            let mut service = ShareServiceClient::new(self.channel.clone());
            let name = name.to_owned();
            async move { service.revoke_share(RevokeShareRequest { name }).await }
        };
        let revoked = repeat(revoke).await;
        revoked.map_err(ClientError::refused("revoking a link"))
    }
}
