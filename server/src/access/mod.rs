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

use tonic::codegen::http::{HeaderMap, Uri};
use yoto_request::RequestError;
use yoto_store::Tenant;

/// Refuses a request that a page of another site has sent.
///
/// # Errors
/// [`OtherSite`](yoto_proto::v1::ErrorReason::OtherSite).
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
