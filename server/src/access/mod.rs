//! Who may call what: the one place in which calls are authorized.
//!
//! ```text
//! call ─► AccessLayer ─► rules: what does its path need? ─► browser or keys: who calls? ─► Caller, Tenant ─► services
//!                                                                         └─ guard: ends its streams once the key has ended
//! ```
//!
//! Each call of the contract names its scope beside it, in `proto/yoto/v1`; [`rules`] has what the pages need. A path without a
//! rule is answered like one that does not exist, so nothing is allowed by being forgotten.

mod browser;
mod credentials;
mod guard;
pub mod keys;
mod layer;
pub mod rates;
mod rules;

pub use layer::AccessLayer;
pub use rules::{brings_file, changes_something, is_of_script, page_of};

use crate::error::RequestError;
use crate::tenant::Tenant;
use std::sync::Arc;
use tonic::Request;
use tonic::codegen::http::{HeaderMap, Uri};
use yoto_proto::v1::ErrorReason;

/// Refuses a request that a page of another site has sent.
///
/// # Errors
/// [`ErrorReason::OtherSite`].
pub fn check_site(uri: &Uri, headers: &HeaderMap) -> Result<(), RequestError> {
    browser::check(uri, headers, false)
}

/// Whom a listener admits without a key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Admission {
    /// The other end is in this process: all calls are this tenant's, and may do everything.
    Process(Tenant),
    /// Programs of this machine, as long as the service has no key: a listener on loopback.
    Machine,
    /// Everybody who reaches the address, as long as the service has no key: an operator has said so.
    Anyone,
    /// Nobody.
    Nobody,
}

/// Who makes a call.
#[derive(Debug, Clone)]
pub(crate) struct Caller {
    tenant: Tenant,
    /// Id of the key.
    key: Option<Arc<str>>,
}

impl Caller {
    /// One without a key, who may do everything for the tenant.
    fn trusted(tenant: Tenant) -> Self {
        Self { tenant, key: None }
    }

    /// Who makes the call `request`.
    ///
    /// # Errors
    /// When no layer has told.
    pub fn of<T>(request: &Request<T>) -> Result<Self, RequestError> {
        let caller = request.extensions().get::<Self>().cloned();
        caller.ok_or(RequestError::NoTenant)
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
