//! The gRPC services, one file each. They parse names and fields, call the layer below, and
//! turn its answer into messages; the rules are in `jobs`, `uploads`, `objects` and `store`.

mod aliases;
mod consents;
mod erasures;
pub mod fields;
mod jobs;
mod keys;
mod models;
mod objects;
mod orders;
mod paging;
mod public;
mod renders;
mod service_status;
mod shares;
mod storage;
mod subjects;
mod tenants;
mod uploads;
mod webhooks;
mod worker_text;
mod workers;

pub use jobs::JobApi;
pub use keys::{KeyApi, new_key};
pub use models::{ModelApi, explained};
pub use objects::ObjectApi;
pub use public::job as public_job;
pub use renders::RenderApi;
pub use service_status::StatusApi;
pub use shares::ShareApi;
pub use storage::StorageApi;
pub use subjects::SubjectApi;
pub use tenants::TenantApi;
pub use uploads::UploadApi;
pub use webhooks::WebhookApi;
pub use workers::WorkerApi;
