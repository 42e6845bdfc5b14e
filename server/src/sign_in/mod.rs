//! Sign-in of people: by a key, or at an issuer of OpenID Connect that the operator names.
//!
//! ```text
//! a page ─► 401 with the sign-in page ─┬─► a key ──────────────────────────────────────┐
//!                                      └─► the issuer ─► /sign-in/back ─► a new key ───┴─► a cookie with the key
//! ```
//!
//! A session is a key: the service makes one for each person that an issuer vouches for, with the tenant and the scopes that the
//! operator's settings grant, and it expires. So a session is listed, expires, is revoked and stands in the audit log as every
//! other key does, on all coordinators of a database. Programs keep keys that are made for them.

mod fetch;
mod grants;
mod issuer;
mod issuer_cache;
mod page;
mod routes;
mod session;

pub(crate) use issuer_cache::IssuerCache;
pub(crate) use page::{asked, signed_out};
pub(crate) use routes::routes;
pub(crate) use session::sign_out;

/// Where people sign in.
const PAGE: &str = "/sign-in";
/// Where the form with a key is sent.
const BY_KEY: &str = "/sign-in/key";
/// What leads to the issuer.
const START: &str = "/sign-in/start";
/// Where the issuer sends people back to.
const BACK: &str = "/sign-in/back";

/// The paths that are open to everybody: who signs in has no key yet.
pub(crate) const OPEN: [&str; 4] = [PAGE, BY_KEY, START, BACK];
