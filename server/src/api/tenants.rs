//! `yoto.v1.TenantService`.

use crate::context::Context;
use std::sync::Arc;
use tonic::{Request, Response, Status};
use yoto_proto::v1::tenant_service_server::TenantService;
use yoto_proto::v1::{
    GetUsageRequest, ListUsageRequest, ListUsageResponse, Quota, SetQuotaRequest, Usage,
};
use yoto_request::{Caller, RequestError};

/// Usage and quotas of tenants.
pub(crate) struct TenantApi {
    /// The shared parts.
    pub context: Arc<Context>,
}

#[tonic::async_trait]
impl TenantService for TenantApi {
    async fn get_usage(
        &self,
        request: Request<GetUsageRequest>,
    ) -> Result<Response<Usage>, Status> {
        let tenant = Caller::of(&request)?.tenant(&request.get_ref().tenant)?;
        let usage = self.context.store.usage(&tenant).await;
        Ok(Response::new(usage.map_err(RequestError::from)?))
    }

    async fn list_usage(
        &self,
        _: Request<ListUsageRequest>,
    ) -> Result<Response<ListUsageResponse>, Status> {
        let usage = self.context.store.all_usage().await;
        let usage = usage.map_err(RequestError::from)?;
        Ok(Response::new(ListUsageResponse { usage }))
    }

    async fn set_quota(
        &self,
        request: Request<SetQuotaRequest>,
    ) -> Result<Response<Usage>, Status> {
        let caller = Caller::of(&request)?;
        let request = request.into_inner();
        let tenant = caller.tenant(&request.tenant)?;
        let quota = checked(request.quota.unwrap_or_default())?;
        let usage = self.context.store.set_quota(&tenant, &quota).await;
        let usage = usage.map_err(RequestError::from)?;
        tracing::info!(%tenant, ?quota, by = caller.key(), "a quota was set");
        // The calls per second are read with the keys.
        self.context.callers.renew_keys().await;
        Ok(Response::new(usage))
    }
}

/// A quota whose numbers can be compared with.
fn checked(quota: Quota) -> Result<Quota, RequestError> {
    let seconds = quota.device_seconds.unwrap_or_default();
    if !seconds.is_finite() || seconds < 0.0 {
        let message = format!("{seconds} is not a number of seconds");
        return Err(RequestError::invalid("quota.device_seconds", message));
    }
    let calls = quota.calls_per_second.unwrap_or_default();
    if !calls.is_finite() || calls < 0.0 {
        let message = format!("{calls} is not a number of calls");
        return Err(RequestError::invalid("quota.calls_per_second", message));
    }
    Ok(quota)
}
