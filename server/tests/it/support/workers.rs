//! The workers' calls.

use super::{Service, eventually, id};
use tonic::Status;
use yoto_objects::Objects;
use yoto_proto::manifest::{Manifest, ManifestObject, VERSION, files};
use yoto_proto::orders::LEVEL;
use yoto_proto::v1::{
    Checkpoint, IngestResult, JobError, JobKind, JobResult, ObjectRef, RenderResult, RenderedFile,
    TrainResult, WorkerDevice, job_result, job_spec,
};
use yoto_proto::worker::v1::end_job_request::Outcome;
use yoto_proto::worker::v1::{
    Claim, EndJobRequest, Lease, LeaseJobRequest, PublishCheckpointRequest, RegisterWorkerRequest,
};
use yoto_proto::{keys, names};

impl Service {
    /// Registers a worker that runs `kinds`.
    pub(crate) async fn worker(&self, kinds: &[&str]) -> String {
        self.worker_called("test worker", kinds).await
    }

    /// The same with a name.
    pub(crate) async fn worker_called(&self, display_name: &str, kinds: &[&str]) -> String {
        let request = RegisterWorkerRequest {
            display_name: display_name.into(),
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

    /// Registers a worker that ingests, and has a pose model for films.
    pub(crate) async fn worker_for_films(&self) -> String {
        let request = RegisterWorkerRequest {
            display_name: "sees people".into(),
            device: Some(WorkerDevice::default()),
            kinds: vec![JobKind::Ingest.into()],
            order_level: LEVEL,
            reads_films: true,
            ..RegisterWorkerRequest::default()
        };
        let registered = self.workers().register_worker(request).await;
        registered.expect("registers").into_inner().worker
    }

    /// Asks for a lease once.
    pub(crate) async fn lease(&self, worker: &str) -> Option<Lease> {
        self.lease_by(worker, "").await
    }

    /// The same in a call that may be repeated.
    pub(crate) async fn lease_by(&self, worker: &str, request_id: &str) -> Option<Lease> {
        self.lease_or_help(worker, request_id, false).await
    }

    /// The same for a worker that may `help` with a render.
    pub(crate) async fn lease_or_help(
        &self,
        worker: &str,
        request_id: &str,
        help: bool,
    ) -> Option<Lease> {
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

    /// Registers a worker of the coordinator's own process, which runs trainings.
    pub(crate) async fn embedded_worker(&self) -> String {
        let request = RegisterWorkerRequest {
            display_name: "embedded".into(),
            device: Some(WorkerDevice::default()),
            kinds: vec![JobKind::Train.into()],
            embedded: true,
            order_level: LEVEL,
            ..RegisterWorkerRequest::default()
        };
        let registered = self.workers().register_worker(request).await;
        registered.expect("registers").into_inner().worker
    }

    /// Asks for a lease until there is one.
    pub(crate) async fn lease_eventually(&self, worker: &str) -> Lease {
        eventually("a lease", || self.lease(worker)).await
    }

    /// Writes an object as a worker would.
    pub(crate) async fn put(&self, key: &str, bytes: &[u8]) -> ObjectRef {
        let objects = Objects::open_with(self.coordinator.objects_url(), &self.environment);
        let objects = objects.expect("opens");
        let written = objects.put(key, bytes.to_vec().into()).await;
        written.expect("writes")
    }

    pub(crate) async fn complete(
        &self,
        lease: &Lease,
        kind: job_result::Kind,
    ) -> Result<(), Status> {
        let result = JobResult { kind: Some(kind) };
        self.end(lease, Outcome::Succeeded(result)).await
    }

    /// Ends a lease.
    pub(crate) async fn end(&self, lease: &Lease, outcome: Outcome) -> Result<(), Status> {
        let request = EndJobRequest {
            claim: Some(claim(lease)),
            outcome: Some(outcome),
        };
        self.workers().end_job(request).await.map(drop)
    }

    /// Completes a leased ingest job with a shard.
    pub(crate) async fn complete_ingest(&self, lease: &Lease) {
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

    /// Publishes a checkpoint of a leased train job.
    pub(crate) async fn publish(&self, lease: &Lease, step: u64) -> Result<Checkpoint, Status> {
        self.publish_with(lease, step, 25.0).await
    }

    /// The same with a held-out PSNR.
    pub(crate) async fn publish_with(
        &self,
        lease: &Lease,
        step: u64,
        psnr: f64,
    ) -> Result<Checkpoint, Status> {
        self.publish_weights(lease, step, psnr, b"weights").await
    }

    /// The same with these weights.
    pub(crate) async fn publish_weights(
        &self,
        lease: &Lease,
        step: u64,
        psnr: f64,
        weights: &[u8],
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
            manifest: Some(self.manifest_with(&folder, step, weights).await),
            bytes: weights.len() as u64,
            psnr: Some(psnr),
            slots: model.slots.iter().map(|slot| slot.slot).collect(),
            ..<_>::default()
        };
        let request = PublishCheckpointRequest {
            claim: Some(claim(lease)),
            checkpoint: Some(checkpoint.clone()),
            save_seconds: 0.5,
        };
        self.workers().publish_checkpoint(request).await?;
        Ok(checkpoint)
    }

    /// The manifest of a checkpoint in `folder`, which has weights alone.
    pub(crate) async fn manifest(&self, folder: &str, step: u64) -> ObjectRef {
        self.manifest_with(folder, step, b"weights").await
    }

    async fn manifest_with(&self, folder: &str, step: u64, weights: &[u8]) -> ObjectRef {
        let key = format!("{folder}/{}", files::WEIGHTS);
        let weights = self.put(&key, weights).await;
        self.manifest_of(folder, step, vec![(files::WEIGHTS, weights)])
            .await
    }

    /// The manifest of a checkpoint in `folder` with these objects.
    pub(crate) async fn manifest_of(
        &self,
        folder: &str,
        step: u64,
        objects: Vec<(&str, ObjectRef)>,
    ) -> ObjectRef {
        let objects = objects.into_iter();
        let objects = objects.map(|(file, object)| ManifestObject {
            file: file.to_owned(),
            key: object.key,
            bytes: object.bytes,
            sha256: object.sha256,
        });
        let manifest = Manifest {
            version: VERSION,
            model: "models/m".to_owned(),
            step,
            job: String::new(),
            job_seconds: 1.0,
            job_steps: step,
            objects: objects.collect(),
        };
        let json = serde_json::to_vec(&manifest).expect("JSON");
        let key = format!("{folder}/{}", files::MANIFEST);
        self.put(&key, &json).await
    }

    /// Completes a leased render with one picture; the picture's key.
    pub(crate) async fn complete_render(&self, lease: &Lease) -> String {
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
    pub(crate) async fn complete_training(&self, lease: &Lease, checkpoint: &Checkpoint) {
        let result = TrainResult {
            checkpoint: checkpoint.name.clone(),
            ..<_>::default()
        };
        self.complete(lease, job_result::Kind::Train(result))
            .await
            .expect("completes");
    }
}

/// The claim of a lease on its job.
pub(crate) fn claim(lease: &Lease) -> Claim {
    let job = lease.job.clone().expect("has a job");
    Claim {
        job: job.name,
        worker: job.worker,
        token: lease.token,
    }
}

/// An error with this code.
pub(crate) fn job_error(code: &str, message: &str) -> JobError {
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

pub(crate) fn job_name(lease: &Lease) -> String {
    lease.job.clone().expect("has a job").name
}
