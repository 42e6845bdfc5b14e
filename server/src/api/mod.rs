//! The gRPC services, one file each. They parse names and fields, call the layer below, and
//! turn its answer into messages; the rules are in `jobs`, `uploads`, `objects` and `store`.

mod aliases;
mod consents;
mod erasures;
pub(crate) mod fields;
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

pub(crate) use jobs::JobApi;
pub(crate) use keys::{KeyApi, new_key};
pub(crate) use models::{ModelApi, explained};
pub(crate) use objects::ObjectApi;
pub(crate) use public::job as public_job;
pub(crate) use renders::RenderApi;
pub(crate) use service_status::StatusApi;
pub(crate) use shares::ShareApi;
pub(crate) use storage::StorageApi;
pub(crate) use subjects::SubjectApi;
pub(crate) use tenants::TenantApi;
pub(crate) use uploads::UploadApi;
pub(crate) use webhooks::WebhookApi;
pub(crate) use workers::{KnownWorkers, WorkerApi};
