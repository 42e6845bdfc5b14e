//! Keys, as the store takes and gives them. What they open is not in them: they have its SHA-256.

use yoto_proto::v1::Scope;

/// A key that is created.
#[derive(Debug, Clone)]
pub struct NewKey {
    /// Human-readable.
    pub display_name: String,
    /// SHA-256 of the key, lower-case hex.
    pub sha256: String,
    /// What it allows.
    pub scopes: Vec<Scope>,
    /// When it ends, seconds since 1970; none: never.
    pub expire_time: Option<f64>,
    /// Whether the service makes it for somebody who signs in.
    pub session: bool,
}

/// A key, as the check of a call needs it.
#[derive(Debug, Clone)]
pub struct KeyRow {
    /// Its id.
    pub id: String,
    /// The tenant whose calls it makes.
    pub tenant: String,
    /// SHA-256 of the key, lower-case hex.
    pub sha256: String,
    /// What it allows.
    pub scopes: Vec<Scope>,
    /// When it ends, seconds since 1970.
    pub expire_time: Option<f64>,
    /// When it was last noted as used, seconds since 1970.
    pub used_time: Option<f64>,
    /// Whether it was revoked.
    pub revoked: bool,
    /// Calls per second of its tenant; none: no limit.
    pub calls_per_second: Option<f64>,
    /// Whether the service has made it for somebody who has signed in.
    pub session: bool,
}
