//! Entries of the audit log in the interface of the store.

/// An entry to write.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NewAuditEntry {
    /// The caller's tenant.
    pub tenant: String,
    /// Id of the caller's key; empty: none was asked for.
    pub key: String,
    /// Path of the method, or verb and path of a form.
    pub call: String,
    /// Names of resources in the request, with spaces between them.
    pub names: String,
    /// Number of the entry with which the call began; `None` in that entry.
    pub began: Option<u64>,
    /// How the call ended; empty while it has not.
    pub outcome: String,
}

/// An entry.
#[derive(Debug, Clone, PartialEq)]
pub struct AuditEntry {
    /// Its number, from 1 on.
    pub number: u64,
    /// When it was written, seconds since 1970.
    pub time: f64,
    /// As in [`NewAuditEntry`].
    pub tenant: String,
    /// As in [`NewAuditEntry`].
    pub key: String,
    /// As in [`NewAuditEntry`].
    pub call: String,
    /// As in [`NewAuditEntry`]; empty if they were those of a person who was erased.
    pub names: String,
    /// SHA-256 of the names as they were.
    pub names_sha256: String,
    /// As in [`NewAuditEntry`].
    pub began: Option<u64>,
    /// As in [`NewAuditEntry`].
    pub outcome: String,
    /// Of this entry and all before it, lower-case hex.
    pub hash: String,
}
