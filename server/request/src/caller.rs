//! Who makes a request. The layer that authorizes calls puts both into its extensions.

use crate::RequestError;
use std::sync::Arc;
use tonic::Request;
use yoto_proto::v1::ErrorReason;
use yoto_store::{Tenant, TraceParent};

/// The header of W3C's Trace Context, and the key of gRPC's metadata.
const TRACE_PARENT: &str = "traceparent";

/// The tenant for which a request is made.
///
/// # Errors
/// When no layer has set it: no request is answered for an unknown tenant.
pub fn tenant_of<T>(request: &Request<T>) -> Result<Tenant, RequestError> {
    let tenant = request.extensions().get::<Tenant>().cloned();
    tenant.ok_or(RequestError::NoTenant)
}

/// The caller's span, if the call names one. A malformed header counts as absent, as the standard asks: a broken trace of
/// the caller is no reason to refuse its job.
pub fn trace_parent_of<T>(request: &Request<T>) -> Option<TraceParent> {
    let value = request.metadata().get(TRACE_PARENT)?;
    TraceParent::parse(value.to_str().ok()?)
}

/// Who makes a call.
#[derive(Debug, Clone)]
pub struct Caller {
    tenant: Tenant,
    /// Id of the key.
    key: Option<Arc<str>>,
}

impl Caller {
    /// One without a key, who may do everything for the tenant.
    pub fn trusted(tenant: Tenant) -> Self {
        Self { tenant, key: None }
    }

    /// One with the key of this id.
    pub fn with_key(tenant: Tenant, key: Arc<str>) -> Self {
        Self {
            tenant,
            key: Some(key),
        }
    }

    /// Who makes the call `request`.
    ///
    /// # Errors
    /// When no layer has told.
    pub fn of<T>(request: &Request<T>) -> Result<Self, RequestError> {
        let caller = request.extensions().get::<Self>().cloned();
        caller.ok_or(RequestError::NoTenant)
    }

    /// The caller's tenant.
    pub fn own_tenant(&self) -> &Tenant {
        &self.tenant
    }

    /// The id of the caller's tenant.
    pub fn id(&self) -> &str {
        self.tenant.id()
    }

    /// The id of the caller's key; none if no key is asked for.
    pub fn key(&self) -> Option<&str> {
        self.key.as_deref()
    }

    /// The tenant that the caller names, empty for its own.
    ///
    /// # Errors
    /// When the name is malformed, or another tenant's and the caller is not the operator of the service.
    pub fn tenant(&self, named: &str) -> Result<Tenant, RequestError> {
        if named.is_empty() || named == self.tenant.id() {
            return Ok(self.tenant.clone());
        }
        if !self.is_of_service() {
            let message = format!(
                "only a key of the tenant {} names other tenants",
                Tenant::default()
            );
            return Err(RequestError::refused(ErrorReason::ScopeMissing, message));
        }
        Tenant::new(named)
            .ok_or_else(|| RequestError::invalid("tenant", "a tenant is 1 to 64 of a-z, 0-9 and -"))
    }

    /// Whether the caller's tenant is that of the service's operators.
    pub fn is_of_service(&self) -> bool {
        self.tenant == Tenant::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_without_a_tenant_is_not_answered() {
        let request = Request::new(());
        assert!(matches!(tenant_of(&request), Err(RequestError::NoTenant)));
    }
}
