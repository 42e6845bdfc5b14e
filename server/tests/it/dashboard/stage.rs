//! A service with one of everything, named by somebody who means harm.

use crate::support::{Service, claim, id, job_error, job_name};
use yoto_proto::keys;
use yoto_proto::orders::LEVEL;
use yoto_proto::v1::{
    ExportForm, ExportResult, ExportSpec, ExportedFile, IngestResult, JobKind, Model, Progress,
    Subject, WorkerDevice, job_result, job_spec,
};
use yoto_proto::worker::v1::end_job_request::Outcome;
use yoto_proto::worker::v1::{HeartbeatRequest, Lease, RegisterWorkerRequest};

/// A name that the service accepts.
pub(crate) const HOSTILE: &str = "<script>alert(1)</script>";

const REPORT: &str = r#"{"frames": 2, "looked_at": 2, "grade": "warn", "measures": [{"kind": "view_coverage", "grade": "warn",
    "value": 1.0, "shown": "1 of 12 <img src=x onerror=x>", "meaning": "few\u202e", "cause": null, "frames": [1]}], "causes": [],
    "headings": [0,0,0,0,0,0,0,0,0,0,0,0], "advice": ["turn <b>once</b>"], "tried": [], "mask_shifts": []}"#;

/// What was set up.
pub(crate) struct Stage {
    pub service: Service,
    pub subject: Subject,
    pub model: Model,
    /// `jobs/{id}` of a training that failed, one that runs, and a render that succeeded.
    pub failed: String,
    pub running: String,
    pub render: String,
    pub lease: Lease,
}

impl Stage {
    pub(crate) async fn set() -> Self {
        Self::set_in(Service::start().await).await
    }

    /// The same in a new service.
    pub(crate) async fn set_in(service: Service) -> Self {
        let subject = service.subject(HOSTILE).await;
        service.upload_good(&subject.name).await;
        let worker = register(&service).await;
        let lease = service.lease(&worker).await.expect("the ingest job waits");
        ingest(&service, &lease).await;
        let subject = service.get_subject(&subject.name).await;
        let model = service.model(HOSTILE).await;
        let model = service.joined(model, &subject).await;

        let (lease, checkpoint) = service.train_to(&model, &worker, 1).await;
        let failed = job_name(&lease);
        let error = job_error("\u{202e}x", "<script>alert(2)</script>\u{202e}\u{1b}[2J");
        service
            .end(&lease, Outcome::Failed(error))
            .await
            .expect("is recorded");

        let render = service
            .render(&model, &subject, &checkpoint.name)
            .await
            .name;
        let lease = service.lease(&worker).await.expect("the render waits");
        service.complete_render(&lease).await;

        service.train(&model).await;
        let lease = service.lease(&worker).await.expect("the training waits");
        let stage = Self {
            running: job_name(&lease),
            service,
            subject,
            model,
            failed,
            render,
            lease,
        };
        for step in [10, 20, 30] {
            stage.report(step).await;
        }
        stage
    }

    /// Reports progress of the running training.
    pub(crate) async fn report(&self, step: u64) {
        let request = HeartbeatRequest {
            claim: Some(claim(&self.lease)),
            progress: Some(Progress {
                phase: "<script>\u{202e}training".into(),
                step,
                fraction: step as f64 / 100.0,
                loss: Some(1.0 / step as f64),
                psnr: Some(20.0 + step as f64 / 10.0),
                train_seconds: step as f64,
                device: "\u{202e}gpu".into(),
                ..Progress::default()
            }),
        };
        let told = self.service.workers().heartbeat(request).await;
        told.expect("holds the lease");
    }

    /// An export of the model that has succeeded with this file.
    pub(crate) async fn export(&self, file: &str, bytes: &[u8]) -> String {
        let spec = ExportSpec {
            model: self.model.name.clone(),
            subject: self.subject.name.clone(),
            form: ExportForm::Page.into(),
            ..ExportSpec::default()
        };
        let job = self.service.create_job(job_spec::Kind::Export(spec)).await;
        let job = job.expect("is queued").name;
        let worker = self.service.worker(&["export"]).await;
        let lease = self.service.lease(&worker).await.expect("the export waits");
        let key = keys::render(id(&job), lease.token, file);
        let exported = ExportedFile {
            file: file.into(),
            object: Some(self.service.put(&key, bytes).await),
            content_type: "text/html; charset=utf-8".into(),
        };
        let result = ExportResult {
            files: vec![exported],
            checkpoint: format!("{}/checkpoints/1", self.model.name),
            splats: 3,
            ..ExportResult::default()
        };
        let kind = job_result::Kind::Export(result);
        let ended = self.service.complete(&lease, kind).await;
        ended.expect("succeeds");
        job
    }
}

async fn register(service: &Service) -> String {
    let kinds = [JobKind::Ingest, JobKind::Train, JobKind::Render];
    let request = RegisterWorkerRequest {
        display_name: HOSTILE.into(),
        device: Some(WorkerDevice {
            backend: "<b>cpu".into(),
            adapter: "\u{202e}gpu".into(),
            ..WorkerDevice::default()
        }),
        kinds: kinds.iter().map(|&it| it.into()).collect(),
        order_level: LEVEL,
        ..RegisterWorkerRequest::default()
    };
    let registered = service.workers().register_worker(request).await;
    registered.expect("registers").into_inner().worker
}

/// Completes a leased ingest job with a report and a thumbnail.
pub(crate) async fn ingest(service: &Service, lease: &Lease) {
    let job = lease.job.clone().expect("has a job");
    let Some(job_spec::Kind::Ingest(spec)) = job.spec.and_then(|spec| spec.kind) else {
        panic!("{} is no ingest job", job.name);
    };
    let (capture, job) = (id(&spec.capture).to_owned(), id(&job.name).to_owned());
    let made = |file: &str| keys::of_capture(&capture, &job, lease.token, file);
    let result = IngestResult {
        shard: Some(
            service
                .put(&keys::shard(&capture, &job, lease.token), b"shard")
                .await,
        ),
        check: Some(service.put(&made(keys::CHECK), REPORT.as_bytes()).await),
        thumbnail: Some(service.put(&made(keys::THUMBNAIL), b"picture").await),
        frames: 2,
        width: 8,
        height: 8,
        warnings: vec!["<script>\u{202e}".into()],
        ..IngestResult::default()
    };
    let completed = service
        .complete(lease, job_result::Kind::Ingest(result))
        .await;
    completed.expect("completes");
}
