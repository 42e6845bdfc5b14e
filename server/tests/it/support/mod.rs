//! A coordinator in a temporary folder with real gRPC, database and objects, and the calls
//! that most tests start with.
#![allow(
    dead_code,
    unused_imports,
    reason = "each test binary uses its own part of this"
)]

mod capture;
mod catalogue;
mod database;
mod expect;
mod http;
mod keys;
mod objects;
mod residue;
mod trained;
mod uploads;
mod workers;

pub(crate) use capture::{File, chunk, chunks, file, headers};
pub(crate) use database::{Database, ON_POSTGRES};
pub(crate) use expect::{assert_invalid, assert_refused, eventually};
pub(crate) use http::{Open, ask, ask_with, listen, listen_as, listen_for};
pub(crate) use keys::{Made, SCOPES};
pub(crate) use objects::ON_S3;
pub(crate) use trained::Trained;
pub(crate) use workers::{claim, job_error, job_name};

use std::path::PathBuf;
use std::time::Duration;
use tempfile::TempDir;
use tokio::task::JoinHandle;
use tonic::transport::Channel;
use yoto_objects::Environment;
use yoto_proto::v1::job_service_client::JobServiceClient;
use yoto_proto::v1::model_service_client::ModelServiceClient;
use yoto_proto::v1::object_service_client::ObjectServiceClient;
use yoto_proto::v1::render_service_client::RenderServiceClient;
use yoto_proto::v1::storage_service_client::StorageServiceClient;
use yoto_proto::v1::subject_service_client::SubjectServiceClient;
use yoto_proto::v1::upload_service_client::UploadServiceClient;
use yoto_proto::v1::{CollectGarbageRequest, CollectGarbageResponse};
use yoto_proto::worker::v1::worker_service_client::WorkerServiceClient;
use yoto_server::{Coordinator, InMemoryConnector, ServerConfig, ServerError, in_memory};

/// A running coordinator.
pub(crate) struct Service {
    pub dir: TempDir,
    pub channel: Channel,
    pub connector: InMemoryConnector,
    pub coordinator: Coordinator,
    pub database: Database,
    /// Of its object store.
    pub environment: Environment,
    serving: JoinHandle<Result<(), ServerError>>,
}

impl Service {
    pub(crate) async fn start() -> Self {
        Self::start_with(|_| {}).await
    }

    pub(crate) async fn start_with(change: impl FnOnce(&mut ServerConfig)) -> Self {
        Self::start_in(TempDir::new().expect("a folder"), change).await
    }

    pub(crate) async fn start_in(dir: TempDir, change: impl FnOnce(&mut ServerConfig)) -> Self {
        let database = Database::of(dir.path());
        let mut config = ServerConfig::new(dir.path());
        config.database = database.url();
        config.objects = objects::url(dir.path());
        config.reap_interval = Duration::from_millis(20);
        change(&mut config);
        Self::open(dir, database, config).await
    }

    /// Another coordinator on the same database and objects, with a data folder of its own. `None` where the database is one
    /// that coordinators do not share.
    pub(crate) async fn beside(&self) -> Option<Self> {
        self.beside_with(|_| {}).await
    }

    pub(crate) async fn beside_with(&self, change: impl FnOnce(&mut ServerConfig)) -> Option<Self> {
        let url = self.database.url()?;
        let dir = TempDir::new().expect("a folder");
        let mut config = ServerConfig::new(dir.path());
        config.database = Some(url);
        config.objects = Some(self.coordinator.objects_url().clone());
        config.reap_interval = Duration::from_millis(20);
        change(&mut config);
        // Its own, which nobody uses.
        let unused = Database::of(dir.path());
        Some(Self::open(dir, unused, config).await)
    }

    /// Ends the coordinator as a crash would: no call is answered, and nothing is given back.
    pub(crate) fn kill(self) -> TempDir {
        self.serving.abort();
        drop(self.coordinator);
        self.database.keep(self.dir.path());
        self.dir
    }

    async fn open(dir: TempDir, database: Database, config: ServerConfig) -> Self {
        let environment = config.environment.clone();
        let coordinator = Coordinator::open(config).await.expect("opens");
        let (connector, incoming) = in_memory();
        let serving = tokio::spawn(coordinator.serve(incoming, std::future::pending()));
        Self {
            dir,
            channel: connector.channel(),
            connector,
            coordinator,
            database,
            environment,
            serving,
        }
    }

    /// Stops the coordinator in order and returns its folder.
    pub(crate) async fn stop(self) -> TempDir {
        drop(self.channel);
        self.coordinator.close().await;
        self.serving.await.expect("no panic").expect("serves");
        self.database.keep(self.dir.path());
        self.dir
    }

    pub(crate) fn subjects(&self) -> SubjectServiceClient<Channel> {
        SubjectServiceClient::new(self.channel.clone())
    }

    pub(crate) fn models(&self) -> ModelServiceClient<Channel> {
        ModelServiceClient::new(self.channel.clone())
    }

    pub(crate) fn jobs(&self) -> JobServiceClient<Channel> {
        JobServiceClient::new(self.channel.clone())
    }

    pub(crate) fn objects(&self) -> ObjectServiceClient<Channel> {
        ObjectServiceClient::new(self.channel.clone())
    }

    pub(crate) fn renders(&self) -> RenderServiceClient<Channel> {
        RenderServiceClient::new(self.channel.clone())
    }

    pub(crate) fn storage(&self) -> StorageServiceClient<Channel> {
        StorageServiceClient::new(self.channel.clone())
    }

    /// Collects garbage: removes what is due, and returns all garbage.
    pub(crate) async fn collect(&self, dry_run: bool, now: bool) -> CollectGarbageResponse {
        let request = CollectGarbageRequest { dry_run, now };
        self.storage()
            .collect_garbage(request)
            .await
            .expect("collects")
            .into_inner()
    }

    pub(crate) fn workers(&self) -> WorkerServiceClient<Channel> {
        WorkerServiceClient::new(self.channel.clone())
    }

    pub(crate) fn uploads(&self) -> UploadServiceClient<Channel> {
        UploadServiceClient::new(self.channel.clone())
    }
}

/// The id in a resource name.
pub(crate) fn id(name: &str) -> &str {
    name.split_once('/').expect("a resource name").1
}
