//! Coordinators on one database and one store of objects, on a clock that is set.

use crate::Plan;
use futures::stream::{self, StreamExt, TryStreamExt};
use std::error::Error;
use std::sync::Arc;
use std::time::Duration;
use tempfile::TempDir;
use tonic::transport::Channel;
use yoto_objects::Objects;
use yoto_proto::names::Collection;
use yoto_proto::orders::LEVEL;
use yoto_proto::v1::job_service_client::JobServiceClient;
use yoto_proto::v1::model_service_client::ModelServiceClient;
use yoto_proto::v1::subject_service_client::SubjectServiceClient;
use yoto_proto::v1::upload_service_client::UploadServiceClient;
use yoto_proto::v1::{
    AddIdentityRequest, CreateJobRequest, CreateModelRequest, CreateSubjectRequest,
    CreateUploadRequest, FileHeader, FinishUploadRequest, IngestResult, JobKind, JobResult,
    JobSpec, ObjectRef, TrainSpec, WorkerDevice, WriteUploadRequest, job_result, job_spec,
};
use yoto_proto::worker::v1::end_job_request::Outcome;
use yoto_proto::worker::v1::worker_service_client::WorkerServiceClient;
use yoto_proto::worker::v1::{Claim, EndJobRequest, Lease, LeaseJobRequest, RegisterWorkerRequest};
use yoto_proto::{crc32c, keys, sha256_hex};
use yoto_server::clock::ManualClock;
use yoto_server::{Coordinator, ServerConfig, in_memory};
use yoto_test_postgres::Database;

pub(crate) type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Longer than any simulation: what a coordinator does by itself is done by events.
const NEVER: Duration = Duration::from_secs(1 << 20);
/// People that are made at the same time.
const AT_ONCE: usize = 8;
/// Owners of trainings.
pub(crate) const OWNERS: usize = 10;

/// Two coordinators on PostgreSQL, or one on SQLite.
pub(crate) struct Stage {
    pub coordinators: Vec<Coordinator>,
    pub channels: Vec<Channel>,
    pub objects: Objects,
    _folders: Vec<TempDir>,
    _database: Option<Database>,
}

impl Stage {
    /// On a clock that is set: what coordinators do by themselves is done by events.
    pub(crate) async fn simulated(
        database: Option<Database>,
        clock: &Arc<ManualClock>,
    ) -> Result<Self> {
        let clock = Arc::clone(clock);
        let settings = move |config: &mut ServerConfig| {
            config.clock = Arc::clone(&clock) as _;
            (config.reap_interval, config.health_interval) = (NEVER, NEVER);
            config.storage.collect_interval = NEVER;
            config.hints = false;
        };
        Self::open(database, settings).await
    }

    pub(crate) async fn open(
        database: Option<Database>,
        settings: impl Fn(&mut ServerConfig),
    ) -> Result<Self> {
        let (mut coordinators, mut channels, mut folders) = (Vec::new(), Vec::new(), Vec::new());
        for number in 0..database.as_ref().map_or(1, |_| 2) {
            let folder = tempfile::tempdir()?;
            let mut config = ServerConfig::new(folder.path());
            config.database = database.as_ref().map(|it| it.url().parse()).transpose()?;
            let first: Option<&Coordinator> = coordinators.first();
            config.objects = first.map(|it| it.objects_url().clone());
            config.storage.min_free_bytes = 0;
            settings(&mut config);
            let coordinator = Coordinator::open(config).await?;
            let (connector, incoming) = in_memory();
            let serving = coordinator.serve(incoming, std::future::pending());
            tokio::spawn(async move {
                if let Err(error) = serving.await {
                    eprintln!("coordinator {number}: {error}");
                }
            });
            channels.push(connector.channel());
            coordinators.push(coordinator);
            folders.push(folder);
        }
        let objects = Objects::open(coordinators[0].objects_url())?;
        Ok(Self {
            coordinators,
            channels,
            objects,
            _folders: folders,
            _database: database,
        })
    }

    /// The channel of the coordinator that the `number`-th caller uses.
    pub(crate) fn channel(&self, number: usize) -> Channel {
        self.channels[number % self.channels.len()].clone()
    }

    pub(crate) fn workers(&self, number: usize) -> WorkerServiceClient<Channel> {
        WorkerServiceClient::new(self.channel(number))
    }

    pub(crate) fn jobs(&self, number: usize) -> JobServiceClient<Channel> {
        JobServiceClient::new(self.channel(number))
    }

    /// Makes people with captures that are READY, a model for each of the first, and their trainings. Returns the jobs.
    pub(crate) async fn fill(&self, plan: &Plan) -> Result<Vec<String>> {
        let mut readers = Vec::new();
        for number in 0..self.channels.len() {
            readers.push(self.register(number, JobKind::Ingest).await?);
        }
        let reader = |number: usize| readers[number % readers.len()].as_str();
        let people = stream::iter(0..plan.people);
        let people = people.map(|number| self.person(number, reader(number)));
        let people: Vec<String> = people.buffered(AT_ONCE).try_collect().await?;
        let first = people.into_iter().take(plan.trainings).enumerate();
        let trainings = stream::iter(first).map(|(number, it)| self.training(number, it));
        trainings.buffered(AT_ONCE).try_collect().await
    }

    /// A model of a person who is made for it.
    pub(crate) async fn model_of_somebody(&self) -> Result<String> {
        let reader = self.register(0, JobKind::Ingest).await?;
        let subject = self.person(0, &reader).await?;
        self.model(0, subject).await
    }

    async fn person(&self, number: usize, reader: &str) -> Result<String> {
        let channel = self.channel(number);
        let mut subjects = SubjectServiceClient::new(channel.clone());
        let request = CreateSubjectRequest {
            display_name: format!("person {number}"),
            ..<_>::default()
        };
        let subject = subjects.create_subject(request).await?.into_inner().name;
        let mut uploads = UploadServiceClient::new(channel);
        let (path, bytes) = ("poses.json", b"{}");
        let request = CreateUploadRequest {
            subject: subject.clone(),
            files: vec![FileHeader {
                path: path.into(),
                bytes: bytes.len() as u64,
                sha256: sha256_hex(bytes),
            }],
            ..<_>::default()
        };
        let name = uploads.create_upload(request).await?.into_inner().name;
        let chunk = WriteUploadRequest {
            upload: name.clone(),
            path: path.into(),
            offset: 0,
            chunk: bytes.to_vec().into(),
            crc32c: crc32c(bytes),
        };
        uploads.write_upload(stream::iter([chunk])).await?;
        let request = FinishUploadRequest {
            name,
            ..<_>::default()
        };
        uploads.finish_upload(request).await?;
        self.ingest(number, reader).await?;
        Ok(subject)
    }

    /// Reads the capture of somebody.
    async fn ingest(&self, number: usize, reader: &str) -> Result<()> {
        let lease = self.lease(number, reader).await?;
        let lease = lease.ok_or("no ingest waits")?;
        let job = lease.job.clone().unwrap_or_default();
        let key = keys::shard(
            Collection::Captures.parse(&job.capture)?,
            Collection::Jobs.parse(&job.name)?,
            lease.token,
        );
        let result = IngestResult {
            shard: Some(self.put(&key, b"shard").await?),
            frames: 2,
            width: 8,
            height: 8,
            ..<_>::default()
        };
        let ended = self.end(number, reader, &lease, job_result::Kind::Ingest(result));
        ended.await
    }

    async fn training(&self, number: usize, subject: String) -> Result<String> {
        let model = self.model(number, subject).await?;
        self.train(number, &model).await
    }

    /// A model of a person.
    async fn model(&self, number: usize, subject: String) -> Result<String> {
        let mut models = ModelServiceClient::new(self.channel(number));
        let request = CreateModelRequest {
            display_name: format!("model {number}"),
            tier: "draft".into(),
            variant: "yoto".into(),
            ..<_>::default()
        };
        let model = models.create_model(request).await?.into_inner().name;
        let request = AddIdentityRequest {
            model: model.clone(),
            subject,
            ..<_>::default()
        };
        models.add_identity(request).await?;
        Ok(model)
    }

    /// Orders a training.
    pub(crate) async fn train(&self, number: usize, model: &str) -> Result<String> {
        let spec = TrainSpec {
            model: model.to_owned(),
            seconds: 1.0,
            ..<_>::default()
        };
        let request = CreateJobRequest {
            spec: Some(JobSpec {
                kind: Some(job_spec::Kind::Train(spec)),
            }),
            owner: format!("owner {}", number % OWNERS),
            ..<_>::default()
        };
        Ok(self
            .jobs(number)
            .create_job(request)
            .await?
            .into_inner()
            .name)
    }

    pub(crate) async fn register(&self, number: usize, kind: JobKind) -> Result<String> {
        let request = RegisterWorkerRequest {
            display_name: format!("worker {number}"),
            device: Some(WorkerDevice::default()),
            kinds: vec![kind.into()],
            order_level: LEVEL,
            ..<_>::default()
        };
        let answer = self.workers(number).register_worker(request).await?;
        Ok(answer.into_inner().worker)
    }

    pub(crate) async fn lease(&self, number: usize, worker: &str) -> Result<Option<Lease>> {
        let request = LeaseJobRequest {
            worker: worker.into(),
            help: true,
            ..<_>::default()
        };
        let answer = self.workers(number).lease_job(request).await?;
        Ok(answer.into_inner().lease)
    }

    pub(crate) async fn put(&self, key: &str, bytes: &[u8]) -> Result<ObjectRef> {
        let bytes = bytes.to_vec().into();
        Ok(self.objects.put(key, bytes).await?)
    }

    /// Ends a lease with a result.
    pub(crate) async fn end(
        &self,
        number: usize,
        worker: &str,
        lease: &Lease,
        kind: job_result::Kind,
    ) -> Result<()> {
        let request = EndJobRequest {
            claim: Some(claim(worker, lease)),
            outcome: Some(Outcome::Succeeded(JobResult { kind: Some(kind) })),
        };
        self.workers(number).end_job(request).await?;
        Ok(())
    }
}

/// What a worker says with each report.
pub(crate) fn claim(worker: &str, lease: &Lease) -> Claim {
    Claim {
        job: lease
            .job
            .as_ref()
            .map(|it| it.name.clone())
            .unwrap_or_default(),
        worker: worker.into(),
        token: lease.token,
    }
}
