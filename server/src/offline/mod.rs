//! What an operator does on the service's host without a coordinator, or beside one: keys, backups, checks, and the binding of an
//! object store.

mod adopt;
mod audit_log;
pub mod backup;
mod erased;
pub mod fsck;
mod key_store;
mod on_host;

pub use adopt::adopt;
pub use audit_log::{AuditError, AuditLog};
pub use erased::{ErasedPerson, erased_in_folder, erased_in_postgres};
pub use key_store::KeyStore;
