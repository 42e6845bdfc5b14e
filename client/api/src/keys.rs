//! Keys of callers.

use super::retry::{read, repeat};
use super::{ClientError, YotoClient};
use yoto_proto::v1::key_service_client::KeyServiceClient;
use yoto_proto::v1::{CreateKeyRequest, CreateKeyResponse, Key, ListKeysRequest, RevokeKeyRequest};

impl YotoClient {
    /// Creates a key. The answer alone has it.
    ///
    /// # Errors
    /// [`ClientError::Refused`]. A call whose answer is lost is not repeated, and leaves a key that nobody has.
    pub async fn create_key(
        &self,
        request: CreateKeyRequest,
    ) -> Result<CreateKeyResponse, ClientError> {
        let mut service = KeyServiceClient::new(self.channel.clone());
        let created = service.create_key(request).await;
        let created = created.map_err(ClientError::refused("creating a key"))?;
        Ok(created.into_inner())
    }

    /// All keys of a tenant, newest first; of the caller's without a name.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn list_keys(&self, tenant: &str) -> Result<Vec<Key>, ClientError> {
        let mut keys = Vec::new();
        let mut page_token = String::new();
        loop {
            let request = ListKeysRequest {
                page_size: 1000,
                page_token,
                tenant: tenant.to_owned(),
            };
            let list = || {
                let mut service = KeyServiceClient::new(self.channel.clone());
                let request = request.clone();
                async move { service.list_keys(request).await }
            };
            let page = read(list).await;
            let page = page.map_err(ClientError::refused("listing keys"))?;
            keys.extend(page.keys);
            page_token = page.next_page_token;
            if page_token.is_empty() {
                return Ok(keys);
            }
        }
    }

    /// Revokes a key, by its resource name.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn revoke_key(&self, name: &str) -> Result<Key, ClientError> {
        let revoke = || {
            let mut service = KeyServiceClient::new(self.channel.clone());
            let name = name.to_owned();
            async move { service.revoke_key(RevokeKeyRequest { name }).await }
        };
        let revoked = repeat(revoke).await;
        revoked.map_err(ClientError::refused("revoking a key"))
    }
}
