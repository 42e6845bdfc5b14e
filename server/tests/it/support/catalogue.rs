//! People, models and jobs.

use super::Service;
use tonic::Status;
use yoto_proto::v1::render_spec::What;
use yoto_proto::v1::{
    AddIdentityRequest, Capture, Checkpoint, CreateJobRequest, CreateModelRequest,
    CreateSubjectRequest, GetCaptureRequest, GetJobRequest, GetSubjectRequest, Job, JobSpec,
    ListCheckpointsRequest, Model, Orbit, RenderSpec, Subject, TrainSpec, job_spec,
};

impl Service {
    pub(crate) async fn subject(&self, display_name: &str) -> Subject {
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

    pub(crate) async fn get_subject(&self, name: &str) -> Subject {
        let request = GetSubjectRequest { name: name.into() };
        self.subjects()
            .get_subject(request)
            .await
            .expect("is there")
            .into_inner()
    }

    pub(crate) async fn get_capture(&self, name: &str) -> Capture {
        let request = GetCaptureRequest { name: name.into() };
        self.subjects()
            .get_capture(request)
            .await
            .expect("is there")
            .into_inner()
    }

    pub(crate) async fn get_job(&self, name: &str) -> Job {
        let request = GetJobRequest { name: name.into() };
        self.jobs()
            .get_job(request)
            .await
            .expect("is there")
            .into_inner()
    }

    /// A subject with an ingested capture.
    pub(crate) async fn ready_subject(&self, display_name: &str) -> Subject {
        let subject = self.subject(display_name).await;
        self.upload_good(&subject.name).await;
        let worker = self.worker(&["ingest"]).await;
        let lease = self.lease(&worker).await.expect("the ingest job waits");
        self.complete_ingest(&lease).await;
        self.get_subject(&subject.name).await
    }

    pub(crate) async fn model(&self, display_name: &str) -> Model {
        self.model_of_tier(display_name, "draft").await
    }

    pub(crate) async fn model_of_tier(&self, display_name: &str, tier: &str) -> Model {
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
    pub(crate) async fn model_of(&self, subject: &Subject) -> Model {
        let model = self.model("shared").await;
        self.joined(model, subject).await
    }

    /// `model` with `subject` in it.
    pub(crate) async fn joined(&self, model: Model, subject: &Subject) -> Model {
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

    pub(crate) async fn create_job(&self, kind: job_spec::Kind) -> Result<Job, Status> {
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

    pub(crate) async fn train(&self, model: &Model) -> Job {
        let spec = TrainSpec {
            model: model.name.clone(),
            seconds: 1.0,
            ..<_>::default()
        };
        self.create_job(job_spec::Kind::Train(spec))
            .await
            .expect("is queued")
    }

    /// Checkpoints of a model, newest first.
    pub(crate) async fn checkpoints(&self, model: &str) -> Vec<Checkpoint> {
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
    pub(crate) async fn render(&self, model: &Model, subject: &Subject, checkpoint: &str) -> Job {
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
}
