//! A person, a model and a checkpoint without real contents, made by the calls that workers make.

use anyhow::{Context, Result};
use std::path::{Path, PathBuf};
use tonic::transport::Channel;
use yoto_client::YotoClient;
use yoto_proto::limits::ANSWER_BYTES;
use yoto_proto::manifest::{Manifest, ManifestObject, VERSION, files};
use yoto_proto::orders::LEVEL;
use yoto_proto::v1::render_spec::What;
use yoto_proto::v1::{
    Checkpoint, IngestResult, JobKind, JobResult, ObjectRef, Orbit, RenderSpec, RenderedFile,
    TrainResult, TrainSpec, WorkerDevice, job_result, job_spec,
};
use yoto_proto::worker::v1::end_job_request::Outcome;
use yoto_proto::worker::v1::worker_service_client::WorkerServiceClient;
use yoto_proto::worker::v1::{
    Claim, CommitOutputRequest, EndJobRequest, LeaseJobRequest, PublishCheckpointRequest,
    RegisterWorkerRequest,
};
use yoto_proto::{keys, names, sha256_hex};
use yoto_tests::upload::file;

/// A running job.
pub(super) struct Lessee {
    pub claim: Claim,
}

/// The person and model of all renders.
pub(super) struct Scene {
    client: YotoClient,
    channel: Channel,
    objects: PathBuf,
    subject: String,
    model: String,
}

impl Scene {
    /// Makes it in the service behind `channel`, whose data folder is `data`.
    ///
    /// # Errors
    /// When a call fails.
    pub(super) async fn make(channel: Channel, data: &Path) -> Result<Self> {
        let client = YotoClient::new(channel.clone());
        let subject = client.create_subject("ada", "made up").await?.name;
        let files = vec![
            file("poses.json", *b"{}"),
            file("frames/000000.png", *b"no picture"),
        ];
        client.upload_capture(&subject, files, |_| {}).await?;
        let mut scene = Self {
            client,
            channel,
            objects: data.join("objects"),
            subject,
            model: String::new(),
        };
        scene.ingest().await?;
        scene.train().await?;
        Ok(scene)
    }

    async fn ingest(&self) -> Result<()> {
        let worker = self.register(JobKind::Ingest).await?;
        let lessee = self.lease(&worker).await?;
        let job = self.client.get_job(&lessee.claim.job).await?;
        let key = keys::shard(id(&job.capture)?, id(&job.name)?, lessee.claim.token);
        let result = IngestResult {
            shard: Some(self.put(&key, b"shard")?),
            frames: 9,
            width: 8,
            height: 8,
            ..IngestResult::default()
        };
        self.end(lessee, job_result::Kind::Ingest(result)).await
    }

    async fn train(&mut self) -> Result<()> {
        let model = self.client.create_model("duo", "draft", "yoto").await?.name;
        self.client.add_identity(&model, &self.subject).await?;
        let spec = TrainSpec {
            model: model.clone(),
            seconds: 1.0,
            ..TrainSpec::default()
        };
        self.client.train(spec).await?;
        let worker = self.register(JobKind::Train).await?;
        let lessee = self.lease(&worker).await?;
        let claim = &lessee.claim;
        let folder = keys::checkpoint(id(&model)?, id(&claim.job)?, claim.token, 1);
        let weights = self.put(&format!("{folder}/{}", files::WEIGHTS), b"weights")?;
        let manifest = Manifest {
            version: VERSION,
            model: model.clone(),
            step: 1,
            job: claim.job.clone(),
            job_seconds: 1.0,
            job_steps: 1,
            objects: vec![ManifestObject {
                file: files::WEIGHTS.to_owned(),
                key: weights.key,
                bytes: weights.bytes,
                sha256: weights.sha256,
            }],
        };
        let manifest = serde_json::to_vec(&manifest)?;
        let checkpoint = Checkpoint {
            name: names::checkpoint(&model, 1),
            step: 1,
            manifest: Some(self.put(&format!("{folder}/{}", files::MANIFEST), &manifest)?),
            bytes: weights.bytes,
            slots: vec![0],
            ..Checkpoint::default()
        };
        let name = checkpoint.name.clone();
        let request = PublishCheckpointRequest {
            claim: Some(claim.clone()),
            checkpoint: Some(checkpoint),
            save_seconds: 0.5,
        };
        self.workers().publish_checkpoint(request).await?;
        let result = TrainResult {
            checkpoint: name,
            ..TrainResult::default()
        };
        self.end(lessee, job_result::Kind::Train(result)).await?;
        self.model = model;
        Ok(())
    }

    fn workers(&self) -> WorkerServiceClient<Channel> {
        WorkerServiceClient::new(self.channel.clone()).max_decoding_message_size(ANSWER_BYTES)
    }

    fn put(&self, key: &str, bytes: &[u8]) -> Result<ObjectRef> {
        let path = self.objects.join(key);
        std::fs::create_dir_all(path.parent().context("a folder")?)?;
        std::fs::write(path, bytes)?;
        Ok(ObjectRef {
            key: key.to_owned(),
            bytes: bytes.len() as u64,
            sha256: sha256_hex(bytes),
        })
    }

    async fn end(&self, lessee: Lessee, kind: job_result::Kind) -> Result<()> {
        let request = EndJobRequest {
            claim: Some(lessee.claim),
            outcome: Some(Outcome::Succeeded(JobResult { kind: Some(kind) })),
        };
        self.workers().end_job(request).await?;
        Ok(())
    }

    /// Queues a render of one picture.
    ///
    /// # Errors
    /// When the call fails.
    pub(super) async fn queue_render(&self) -> Result<()> {
        let spec = self.render(What::Orbit(Orbit {
            frame: 0,
            views: 1,
            size: 8,
        }));
        self.queue(spec).await
    }

    /// A render of the person.
    pub(super) fn render(&self, what: What) -> RenderSpec {
        RenderSpec {
            model: self.model.clone(),
            subject: self.subject.clone(),
            what: Some(what),
            ..RenderSpec::default()
        }
    }

    /// Queues a render.
    ///
    /// # Errors
    /// When the call fails.
    pub(super) async fn queue(&self, spec: RenderSpec) -> Result<()> {
        self.client.create_job(job_spec::Kind::Render(spec)).await?;
        Ok(())
    }

    /// Commits the picture of a render with this `number`.
    ///
    /// # Errors
    /// When the call fails.
    pub(super) async fn commit_file(&self, lessee: &Lessee, number: u32) -> Result<()> {
        let (claim, file) = (&lessee.claim, keys::picture(number));
        let key = keys::render(id(&claim.job)?, claim.token, &file);
        let object = Some(self.put(&key, b"a picture")?);
        let request = CommitOutputRequest {
            claim: Some(claim.clone()),
            file: Some(RenderedFile { file, object }),
        };
        self.workers().commit_output(request).await?;
        Ok(())
    }

    /// Registers a worker for one kind of jobs.
    ///
    /// # Errors
    /// When the call fails.
    pub(super) async fn register(&self, kind: JobKind) -> Result<String> {
        let request = RegisterWorkerRequest {
            display_name: "load".into(),
            device: Some(WorkerDevice::default()),
            kinds: vec![kind.into()],
            order_level: LEVEL,
            ..RegisterWorkerRequest::default()
        };
        Ok(self
            .workers()
            .register_worker(request)
            .await?
            .into_inner()
            .worker)
    }

    /// Leases a job.
    ///
    /// # Errors
    /// When the call fails, or no job waits.
    pub(super) async fn lease(&self, worker: &str) -> Result<Lessee> {
        let request = LeaseJobRequest {
            worker: worker.to_owned(),
            request_id: String::new(),
            help: false,
        };
        let answer = self.workers().lease_job(request).await?.into_inner();
        let lease = answer.lease.context("a job waits")?;
        let job = lease.job.context("a lease has a job")?;
        Ok(Lessee {
            claim: Claim {
                job: job.name,
                worker: worker.to_owned(),
                token: lease.token,
            },
        })
    }
}

/// The id in a resource name.
fn id(name: &str) -> Result<&str> {
    Ok(name.split_once('/').context("a resource name")?.1)
}
