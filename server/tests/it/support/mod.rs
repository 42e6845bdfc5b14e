//! A coordinator in a temporary folder with real gRPC, database and objects, and the calls
//! that most tests start with.
#![allow(
    dead_code,
    unused_imports,
    reason = "each test binary uses its own part of this"
)]

mod capture;
mod database;
mod expect;
mod trained;

pub use capture::{File, chunk, chunks, file, headers};
pub use database::{Database, ON_POSTGRES};
pub use expect::{assert_invalid, assert_refused, eventually};
pub use trained::Trained;

use futures::stream;
use object_store::ObjectStoreExt;
use object_store::local::LocalFileSystem;
use object_store::path::Path as Key;
use std::path::PathBuf;
use std::time::Duration;
use tempfile::TempDir;
use tokio::task::JoinHandle;
use tonic::Status;
use tonic::transport::Channel;
use yoto_proto::orders::LEVEL;
use yoto_proto::v1::job_service_client::JobServiceClient;
use yoto_proto::v1::model_service_client::ModelServiceClient;
use yoto_proto::v1::object_service_client::ObjectServiceClient;
use yoto_proto::v1::render_service_client::RenderServiceClient;
use yoto_proto::v1::render_spec::What;
use yoto_proto::v1::storage_service_client::StorageServiceClient;
use yoto_proto::v1::subject_service_client::SubjectServiceClient;
use yoto_proto::v1::upload_service_client::UploadServiceClient;
use yoto_proto::v1::{
    AddIdentityRequest, Capture, Checkpoint, CollectGarbageRequest, CollectGarbageResponse,
    CreateJobRequest, CreateModelRequest, CreateSubjectRequest, CreateUploadRequest,
    FinishUploadRequest, GetCaptureRequest, GetJobRequest, GetSubjectRequest, GetUploadRequest,
    IngestResult, Job, JobError, JobKind, JobResult, JobSpec, ListCheckpointsRequest, Model,
    ObjectRef, Orbit, RenderResult, RenderSpec, RenderedFile, Subject, TrainResult, TrainSpec,
    Upload, WorkerDevice, WriteUploadRequest, job_result, job_spec,
};
use yoto_proto::worker::v1::end_job_request::Outcome;
use yoto_proto::worker::v1::worker_service_client::WorkerServiceClient;
use yoto_proto::worker::v1::{
    Claim, EndJobRequest, Lease, LeaseJobRequest, PublishCheckpointRequest, RegisterWorkerRequest,
};
use yoto_proto::{keys, names, sha256_hex};
use yoto_server::{Coordinator, InMemoryConnector, ServerConfig, ServerError, in_memory};

/// A running coordinator.
pub struct Service {
    pub dir: TempDir,
    pub channel: Channel,
    pub connector: InMemoryConnector,
    pub coordinator: Coordinator,
    pub database: Database,
    serving: JoinHandle<Result<(), ServerError>>,
}

impl Service {
    pub async fn start() -> Self {
        Self::start_with(|_| {}).await
    }

    pub async fn start_with(change: impl FnOnce(&mut ServerConfig)) -> Self {
        Self::start_in(TempDir::new().expect("a folder"), change).await
    }

    pub async fn start_in(dir: TempDir, change: impl FnOnce(&mut ServerConfig)) -> Self {
        let database = Database::of(dir.path());
        let mut config = ServerConfig::new(dir.path());
        config.database = database.url();
        config.reap_interval = Duration::from_millis(20);
        change(&mut config);
        let coordinator = Coordinator::open(config).await.expect("opens");
        let (connector, incoming) = in_memory();
        let serving = tokio::spawn(coordinator.serve(incoming, std::future::pending()));
        Self {
            dir,
            channel: connector.channel(),
            connector,
            coordinator,
            database,
            serving,
        }
    }

    /// Stops the coordinator in order and returns its folder.
    pub async fn stop(self) -> TempDir {
        drop(self.channel);
        self.coordinator.close().await;
        self.serving.await.expect("no panic").expect("serves");
        self.database.keep(self.dir.path());
        self.dir
    }

    pub fn subjects(&self) -> SubjectServiceClient<Channel> {
        SubjectServiceClient::new(self.channel.clone())
    }

    pub fn models(&self) -> ModelServiceClient<Channel> {
        ModelServiceClient::new(self.channel.clone())
    }

    pub fn jobs(&self) -> JobServiceClient<Channel> {
        JobServiceClient::new(self.channel.clone())
    }

    pub fn objects(&self) -> ObjectServiceClient<Channel> {
        ObjectServiceClient::new(self.channel.clone())
    }

    pub fn renders(&self) -> RenderServiceClient<Channel> {
        RenderServiceClient::new(self.channel.clone())
    }

    pub fn storage(&self) -> StorageServiceClient<Channel> {
        StorageServiceClient::new(self.channel.clone())
    }

    /// Collects garbage: removes what is due, and returns all garbage.
    pub async fn collect(&self, dry_run: bool, now: bool) -> CollectGarbageResponse {
        let request = CollectGarbageRequest { dry_run, now };
        self.storage()
            .collect_garbage(request)
            .await
            .expect("collects")
            .into_inner()
    }

    pub fn workers(&self) -> WorkerServiceClient<Channel> {
        WorkerServiceClient::new(self.channel.clone())
    }

    pub async fn subject(&self, display_name: &str) -> Subject {
        let request = CreateSubjectRequest {
            display_name: display_name.into(),
            ..<_>::default()
        };
        self.subjects()
            .create_subject(request)
            .await
            .expect("creates")
            .into_inner()
    }

    pub async fn get_subject(&self, name: &str) -> Subject {
        let request = GetSubjectRequest { name: name.into() };
        self.subjects()
            .get_subject(request)
            .await
            .expect("is there")
            .into_inner()
    }

    pub async fn get_capture(&self, name: &str) -> Capture {
        let request = GetCaptureRequest { name: name.into() };
        self.subjects()
            .get_capture(request)
            .await
            .expect("is there")
            .into_inner()
    }

    pub async fn get_job(&self, name: &str) -> Job {
        let request = GetJobRequest { name: name.into() };
        self.jobs()
            .get_job(request)
            .await
            .expect("is there")
            .into_inner()
    }

    pub fn uploads(&self) -> UploadServiceClient<Channel> {
        UploadServiceClient::new(self.channel.clone())
    }

    /// Opens an upload of `files`.
    pub async fn open_upload(&self, subject: &str, files: &[File]) -> Result<Upload, Status> {
        let request = CreateUploadRequest {
            subject: subject.into(),
            files: headers(files),
            request_id: String::new(),
        };
        let opened = self.uploads().create_upload(request).await;
        opened.map(|answer| answer.into_inner())
    }

    /// Sends `messages` in one stream. Returns the committed bytes.
    pub async fn write(&self, messages: Vec<WriteUploadRequest>) -> Result<u64, Status> {
        let written = self.uploads().write_upload(stream::iter(messages)).await;
        written.map(|answer| answer.into_inner().committed_bytes)
    }

    /// An upload, after its writer has stopped.
    pub async fn get_upload(&self, name: &str) -> Result<Upload, Status> {
        let request = GetUploadRequest {
            name: name.into(),
            stop_writer: true,
        };
        let upload = self.uploads().get_upload(request).await;
        upload.map(|answer| answer.into_inner())
    }

    pub async fn finish(&self, upload: &str) -> Result<Capture, Status> {
        let request = FinishUploadRequest {
            name: upload.into(),
            request_id: String::new(),
        };
        let finished = self.uploads().finish_upload(request).await;
        finished.map(|answer| answer.into_inner())
    }

    /// Uploads `files` in one stream.
    pub async fn upload(&self, subject: &str, files: Vec<File>) -> Result<Capture, Status> {
        let upload = self.open_upload(subject, &files).await?.name;
        self.write(chunks(&upload, &files)).await?;
        self.finish(&upload).await
    }

    pub async fn upload_good(&self, subject: &str) -> Capture {
        let files = vec![
            file("poses.json", b"{}"),
            file("frames/000000.png", b"not looked at"),
        ];
        self.upload(subject, files).await.expect("uploads")
    }

    /// Registers a worker that runs `kinds`.
    pub async fn worker(&self, kinds: &[&str]) -> String {
        let request = RegisterWorkerRequest {
            display_name: "test worker".into(),
            device: Some(WorkerDevice {
                backend: "cpu".into(),
                ..<_>::default()
            }),
            kinds: kinds.iter().map(|kind| job_kind(kind) as i32).collect(),
            order_level: LEVEL,
            ..RegisterWorkerRequest::default()
        };
        self.workers()
            .register_worker(request)
            .await
            .expect("registers")
            .into_inner()
            .worker
    }

    /// Asks for a lease once.
    pub async fn lease(&self, worker: &str) -> Option<Lease> {
        self.lease_by(worker, "").await
    }

    /// The same in a call that may be repeated.
    pub async fn lease_by(&self, worker: &str, request_id: &str) -> Option<Lease> {
        self.lease_or_help(worker, request_id, false).await
    }

    /// The same for a worker that may `help` with a render.
    pub async fn lease_or_help(&self, worker: &str, request_id: &str, help: bool) -> Option<Lease> {
        let request = LeaseJobRequest {
            worker: worker.into(),
            request_id: request_id.into(),
            help,
        };
        self.workers()
            .lease_job(request)
            .await
            .expect("answers")
            .into_inner()
            .lease
    }

    /// Asks for a lease until there is one.
    pub async fn lease_eventually(&self, worker: &str) -> Lease {
        eventually("a lease", || self.lease(worker)).await
    }

    /// Writes an object as a worker would.
    pub async fn put(&self, key: &str, bytes: &[u8]) -> ObjectRef {
        let root = self
            .coordinator
            .objects_url()
            .to_file_path()
            .expect("a local store");
        let store = LocalFileSystem::new_with_prefix(root).expect("opens");
        store
            .put(&Key::parse(key).expect("a key"), bytes.to_vec().into())
            .await
            .expect("writes");
        ObjectRef {
            key: key.into(),
            bytes: bytes.len() as u64,
            sha256: sha256_hex(bytes),
        }
    }

    pub async fn complete(&self, lease: &Lease, kind: job_result::Kind) -> Result<(), Status> {
        let result = JobResult { kind: Some(kind) };
        self.end(lease, Outcome::Succeeded(result)).await
    }

    /// Ends a lease.
    pub async fn end(&self, lease: &Lease, outcome: Outcome) -> Result<(), Status> {
        let request = EndJobRequest {
            claim: Some(claim(lease)),
            outcome: Some(outcome),
        };
        self.workers().end_job(request).await.map(drop)
    }

    /// Completes a leased ingest job with a shard.
    pub async fn complete_ingest(&self, lease: &Lease) {
        let job = lease.job.clone().expect("has a job");
        let Some(job_spec::Kind::Ingest(spec)) = job.spec.and_then(|spec| spec.kind) else {
            panic!("{} is no ingest job", job.name);
        };
        let key = keys::shard(id(&spec.capture), id(&job.name), lease.token);
        let shard = Some(self.put(&key, b"shard").await);
        let result = IngestResult {
            notes: Vec::new(),
            shard,
            frames: 2,
            width: 8,
            height: 8,
            ..IngestResult::default()
        };
        self.complete(lease, job_result::Kind::Ingest(result))
            .await
            .expect("completes");
    }

    /// A subject with an ingested capture.
    pub async fn ready_subject(&self, display_name: &str) -> Subject {
        let subject = self.subject(display_name).await;
        self.upload_good(&subject.name).await;
        let worker = self.worker(&["ingest"]).await;
        let lease = self.lease(&worker).await.expect("the ingest job waits");
        self.complete_ingest(&lease).await;
        self.get_subject(&subject.name).await
    }

    pub async fn model(&self, display_name: &str) -> Model {
        self.model_of_tier(display_name, "draft").await
    }

    pub async fn model_of_tier(&self, display_name: &str, tier: &str) -> Model {
        let request = CreateModelRequest {
            display_name: display_name.into(),
            tier: tier.into(),
            variant: "yoto".into(),
            ..<_>::default()
        };
        self.models()
            .create_model(request)
            .await
            .expect("creates")
            .into_inner()
    }

    /// A model with one ingested subject.
    pub async fn model_of(&self, subject: &Subject) -> Model {
        let model = self.model("shared").await;
        self.joined(model, subject).await
    }

    /// `model` with `subject` in it.
    pub async fn joined(&self, model: Model, subject: &Subject) -> Model {
        let (model, subject) = (model.name.clone(), subject.name.clone());
        let request = AddIdentityRequest {
            model: model.clone(),
            subject,
            ..<_>::default()
        };
        self.models()
            .add_identity(request)
            .await
            .expect("gets a slot");
        let request = yoto_proto::v1::GetModelRequest { name: model };
        self.models()
            .get_model(request)
            .await
            .expect("is there")
            .into_inner()
    }

    pub async fn create_job(&self, kind: job_spec::Kind) -> Result<Job, Status> {
        let spec = Some(JobSpec { kind: Some(kind) });
        let request = CreateJobRequest {
            spec,
            ..CreateJobRequest::default()
        };
        self.jobs()
            .create_job(request)
            .await
            .map(|answer| answer.into_inner())
    }

    pub async fn train(&self, model: &Model) -> Job {
        let spec = TrainSpec {
            model: model.name.clone(),
            seconds: 1.0,
            ..<_>::default()
        };
        self.create_job(job_spec::Kind::Train(spec))
            .await
            .expect("is queued")
    }

    /// Publishes a checkpoint of a leased train job.
    pub async fn publish(&self, lease: &Lease, step: u64) -> Result<Checkpoint, Status> {
        self.publish_with(lease, step, 25.0).await
    }

    /// The same with a held-out PSNR.
    pub async fn publish_with(
        &self,
        lease: &Lease,
        step: u64,
        psnr: f64,
    ) -> Result<Checkpoint, Status> {
        let model = lease
            .inputs
            .clone()
            .and_then(|inputs| inputs.model)
            .expect("has a model");
        let job = job_name(lease);
        let folder = keys::checkpoint(id(&model.name), id(&job), lease.token, step);
        let checkpoint = Checkpoint {
            name: names::checkpoint(&model.name, step),
            step,
            manifest: Some(self.put(&format!("{folder}/manifest.json"), b"{}").await),
            bytes: 2,
            psnr: Some(psnr),
            slots: model.slots.iter().map(|slot| slot.slot).collect(),
            ..<_>::default()
        };
        let request = PublishCheckpointRequest {
            claim: Some(claim(lease)),
            checkpoint: Some(checkpoint.clone()),
        };
        self.workers().publish_checkpoint(request).await?;
        Ok(checkpoint)
    }

    /// Checkpoints of a model, newest first.
    pub async fn checkpoints(&self, model: &str) -> Vec<Checkpoint> {
        let request = ListCheckpointsRequest {
            model: model.into(),
            ..ListCheckpointsRequest::default()
        };
        self.models()
            .list_checkpoints(request)
            .await
            .expect("lists")
            .into_inner()
            .checkpoints
    }

    /// Queues a render of one picture.
    pub async fn render(&self, model: &Model, subject: &Subject, checkpoint: &str) -> Job {
        let spec = RenderSpec {
            model: model.name.clone(),
            subject: subject.name.clone(),
            checkpoint: checkpoint.into(),
            what: Some(What::Orbit(Orbit {
                frame: 0,
                views: 1,
                size: 8,
            })),
            ..<_>::default()
        };
        self.create_job(job_spec::Kind::Render(spec))
            .await
            .expect("is queued")
    }

    /// Completes a leased render with one picture; the picture's key.
    pub async fn complete_render(&self, lease: &Lease) -> String {
        let key = keys::render(id(&job_name(lease)), lease.token, "000000.png");
        let files = vec![RenderedFile {
            file: "000000.png".into(),
            object: Some(self.put(&key, b"picture").await),
        }];
        let result = RenderResult {
            files,
            ..<_>::default()
        };
        self.complete(lease, job_result::Kind::Render(result))
            .await
            .expect("completes");
        key
    }

    /// Ends a leased training with `checkpoint` as its result.
    pub async fn complete_training(&self, lease: &Lease, checkpoint: &Checkpoint) {
        let result = TrainResult {
            checkpoint: checkpoint.name.clone(),
            ..<_>::default()
        };
        self.complete(lease, job_result::Kind::Train(result))
            .await
            .expect("completes");
    }

    /// Whether the object store has this file or folder.
    pub fn has(&self, key: &str) -> bool {
        self.path(key).exists()
    }

    /// Where the object store has `key`.
    pub fn path(&self, key: &str) -> PathBuf {
        let root = self.coordinator.objects_url().to_file_path();
        root.expect("a local store").join(key)
    }

    /// Every file below the object store's root.
    pub fn stored_files(&self) -> Vec<PathBuf> {
        let root = self
            .coordinator
            .objects_url()
            .to_file_path()
            .expect("a local store");
        let (mut files, mut folders) = (Vec::new(), vec![root]);
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).expect("lists") {
                let path = entry.expect("an entry").path();
                if path.is_dir() {
                    folders.push(path)
                } else {
                    files.push(path)
                }
            }
        }
        files
    }
}

/// The claim of a lease on its job.
pub fn claim(lease: &Lease) -> Claim {
    let job = lease.job.clone().expect("has a job");
    Claim {
        job: job.name,
        worker: job.worker,
        token: lease.token,
    }
}

/// An error with this code.
pub fn job_error(code: &str, message: &str) -> JobError {
    JobError {
        code: code.into(),
        message: message.into(),
        violations: Vec::new(),
    }
}

fn job_kind(name: &str) -> JobKind {
    match name {
        "ingest" => JobKind::Ingest,
        "train" => JobKind::Train,
        "render" => JobKind::Render,
        "evaluate" => JobKind::Evaluate,
        "export" => JobKind::Export,
        other => panic!("{other} is not a kind of job"),
    }
}

pub fn job_name(lease: &Lease) -> String {
    lease.job.clone().expect("has a job").name
}

/// The id in a resource name.
pub fn id(name: &str) -> &str {
    name.split_once('/').expect("a resource name").1
}
