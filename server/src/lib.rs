//! The coordinator: API, jobs, catalogue, objects. It has no tensors and decodes no media.
//!
//! A request passes through the layers: `api` (gRPC) → `jobs`, `uploads` and `objects` → `store`
//! (database, by the `rules` of the queue). [`Coordinator`] opens them on a data folder and serves them on any
//! stream of connections, over a network or [in memory](in_memory()).

mod access;
mod api;
mod audit;
mod capacity;
pub mod config;
mod context;
mod coordinator;
mod data_dir;
mod erasure;
mod error;
mod health;
mod jobs;
mod listen;
mod notify;
mod objects;
mod offline;
mod otlp;
mod outgoing;
mod pages;
mod serve;
mod sign_in;
mod traffic;
mod uploads;
mod webhooks;

pub use access::Admission;
pub use capacity::capacity_table;
pub use config::{
    Grant, OidcConfig, OtlpConfig, OtlpEndpoint, OtlpError, OtlpHeaders, ServerConfig,
    StorageLimits, TrafficLimits, UploadLimits,
};
pub use coordinator::Coordinator;
pub use error::ServerError;
pub use listen::{
    Certificates, Encrypted, InMemoryConnector, InMemoryIncoming, TlsError, TlsFiles, in_memory,
    tcp, tls,
};
pub use offline::{
    AuditError, AuditLog, ErasedPerson, KeyStore, adopt, backup, erased_in_folder,
    erased_in_postgres, fsck,
};
pub use yoto_objects::{Environment, ObjectsError, shown};
pub use yoto_process::{clock, faults};
pub use yoto_store::audit_chain::{Broken, Head as AuditHead};
pub use yoto_store::binding::BindingError;
pub use yoto_store::{AuditEntry, PostgresUrl, StoreError, Tenant, UrlError};
