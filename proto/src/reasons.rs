//! Reasons of refusals (`ErrorInfo.reason`) on which clients and workers act. Others only inform people.

/// A chunk was altered in transit: the client sends it again.
pub const CORRUPT_CHUNK: &str = "CORRUPT_CHUNK";
/// The resource does not exist, or was deleted.
pub const NOT_FOUND: &str = "NOT_FOUND";
/// The claim is not the newest of its job: the worker has lost the lease.
pub const STALE_LEASE: &str = "STALE_LEASE";
/// Bytes of an upload are missing: the client sends them, again if they were lost.
pub const UPLOAD_INCOMPLETE: &str = "UPLOAD_INCOMPLETE";
