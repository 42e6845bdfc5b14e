//! Usage and quotas of tenants.

use super::retry::{read, repeat};
use super::{ClientError, YotoClient};
use yoto_proto::v1::tenant_service_client::TenantServiceClient;
use yoto_proto::v1::{GetUsageRequest, ListUsageRequest, Quota, SetQuotaRequest, Usage};

impl YotoClient {
    /// What a tenant uses, with its quota; the caller's tenant without a name.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn usage(&self, tenant: &str) -> Result<Usage, ClientError> {
        let get = || {
            let mut service = TenantServiceClient::new(self.channel.clone());
            let tenant = tenant.to_owned();
            async move { service.get_usage(GetUsageRequest { tenant }).await }
        };
        let usage = read(get).await;
        usage.map_err(ClientError::refused("reading what a tenant uses"))
    }

    /// What each tenant uses, by id.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn all_usage(&self) -> Result<Vec<Usage>, ClientError> {
        let list = || {
            let mut service = TenantServiceClient::new(self.channel.clone());
            async move { service.list_usage(ListUsageRequest {}).await }
        };
        let listed = read(list).await;
        let listed = listed.map_err(ClientError::refused("listing what tenants use"))?;
        Ok(listed.usage)
    }

    /// Replaces the quota of a tenant, and returns what it uses.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn set_quota(&self, tenant: &str, quota: Quota) -> Result<Usage, ClientError> {
        let set = || {
            let mut service = TenantServiceClient::new(self.channel.clone());
            let request = SetQuotaRequest {
                tenant: tenant.to_owned(),
                quota: Some(quota),
            };
            async move { service.set_quota(request).await }
        };
        let usage = repeat(set).await;
        usage.map_err(ClientError::refused("setting a quota"))
    }
}
