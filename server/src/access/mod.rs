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
pub(crate) mod cookies;
mod credentials;
mod guard;
pub(crate) mod keys;
mod layer;
mod rates;
mod rules;

pub(crate) use layer::{AccessLayer, SignInPage};
pub(crate) use rules::{brings_file, changes_something, is_of_script, is_probe, page_of};

use keys::{KeyRing, Keys};
use rates::Rates;
use std::sync::Arc;
use tonic::codegen::http::{HeaderMap, Uri};
use yoto_request::RequestError;
use yoto_store::{Store, StoreError, Tenant};

/// Who may call: the keys of the service, and the calls per second of each tenant.
#[derive(Debug)]
pub(crate) struct Callers {
    store: Arc<Store>,
    ring: KeyRing,
    rates: Rates,
    /// Whether people sign in at an issuer. Callers are then asked for a key also before there is any.
    at_issuer: bool,
}

impl Callers {
    /// Those of the service with this `store`, who may sign in at an issuer.
    pub(crate) fn new(store: &Arc<Store>, at_issuer: bool) -> Self {
        Self {
            store: Arc::clone(store),
            ring: KeyRing::default(),
            rates: Rates::default(),
            at_issuer,
        }
    }

    /// The keys, no older than [`keys::FRESH`].
    ///
    /// # Errors
    /// When the database can't be read: nobody knows then whose key was revoked.
    pub(crate) async fn keys(&self) -> Result<Arc<Keys>, StoreError> {
        self.ring.current(&self.store).await
    }

    /// Reads the keys after a change, and has running streams check theirs now.
    pub(crate) async fn renew_keys(&self) {
        self.ring.renew(&self.store).await;
    }
}

/// Refuses a request that a page of another site has sent.
///
/// # Errors
/// [`OtherSite`](yoto_proto::v1::ErrorReason::OtherSite).
pub(crate) fn check_site(uri: &Uri, headers: &HeaderMap) -> Result<(), RequestError> {
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
