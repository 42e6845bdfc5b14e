//! What the coordinator gives its pages.

use super::reads::Reads;
use axum::response::Response;
use futures::stream::BoxStream;
use std::sync::Arc;
use std::time::Duration;
use tonic::Status;
use yoto_proto::v1::job_service_server::JobService;
use yoto_proto::v1::model_service_server::ModelService;
use yoto_proto::v1::object_service_server::ObjectService;
use yoto_proto::v1::share_service_server::ShareService;
use yoto_proto::v1::status_service_server::StatusService;
use yoto_proto::v1::subject_service_server::SubjectService;
use yoto_proto::v1::tenant_service_server::TenantService;
use yoto_proto::v1::{
    DownloadObjectResponse, GetRefinedPosesResponse, Key, WatchJobResponse, WatchJobsResponse,
};

/// An answer that is a stream.
type Answers<T> = BoxStream<'static, Result<T, Status>>;

/// The services of the contract that pages call: a page has their rules, limits and errors.
#[expect(missing_docs, reason = "each is the service of its name")]
pub struct Services {
    pub subjects: Arc<dyn SubjectService>,
    pub models: Arc<dyn ModelService<GetRefinedPosesStream = Answers<GetRefinedPosesResponse>>>,
    pub jobs: Arc<
        dyn JobService<
                WatchJobStream = Answers<WatchJobResponse>,
                WatchJobsStream = Answers<WatchJobsResponse>,
            >,
    >,
    pub objects: Arc<dyn ObjectService<DownloadObjectStream = Answers<DownloadObjectResponse>>>,
    pub status: Arc<dyn StatusService>,
    pub tenants: Arc<dyn TenantService>,
    pub shares: Arc<dyn ShareService>,
}

/// What pages show or do that is no call.
#[tonic::async_trait]
pub trait Backend: Reads {
    /// The id of the object store, from which tokens of forms are made.
    fn store_id(&self) -> &str;

    /// The service's time, seconds since 1970.
    fn now(&self) -> f64;

    /// Why the coordinator can't serve, in words for an operator; empty if all is well.
    fn health_faults(&self) -> Vec<&'static str>;

    /// When this coordinator last collected garbage, seconds since 1970.
    fn last_collected(&self) -> Option<f64>;

    /// Time from when objects are found to be garbage until they are removed.
    fn grace(&self) -> Duration;

    /// The key of this id.
    ///
    /// # Errors
    /// When the key does not exist, or the database fails.
    async fn key(&self, id: &str) -> Result<Key, Status>;

    /// Ends the session with the key of this id.
    ///
    /// # Errors
    /// When the database fails.
    async fn sign_out(&self, key: &str) -> Result<(), Status>;

    /// The answer to somebody whose session has ended.
    fn signed_out(&self) -> Response;
}
