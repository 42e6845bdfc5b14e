//! The calls of a client that repeats each, under its request id, until it has a definite answer.

use anyhow::{Context, Result};
use std::future::Future;
use std::net::SocketAddr;
use std::time::{Duration, Instant};
use tonic::transport::Channel;
use tonic::{Code, Response, Status};
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_check_response::ServingStatus;
use tonic_health::pb::health_client::HealthClient;
use yoto_client::Addresses;
use yoto_proto::retry::{FailureCause, failure_cause};
use yoto_proto::v1::job_service_client::JobServiceClient;
use yoto_proto::v1::model_service_client::ModelServiceClient;
use yoto_proto::v1::subject_service_client::SubjectServiceClient;
use yoto_proto::v1::{
    AddIdentityRequest, CancelJobRequest, Capture, Checkpoint, CreateJobRequest,
    CreateModelRequest, CreateSubjectRequest, DeleteJobRequest, GetCaptureRequest, GetJobRequest,
    Job, ListCheckpointsRequest, ListJobsRequest, WatchJobRequest, WatchJobResponse, job,
};
use yoto_proto::worker::v1::worker_service_client::WorkerServiceClient;

/// Longest wait for one answer.
const ANSWER: Duration = Duration::from_secs(10);
/// Longest time without a definite answer.
const PATIENCE: Duration = Duration::from_secs(90);
/// Pause before a repetition.
const PAUSE: Duration = Duration::from_millis(150);

/// Calls `call` until there is a definite answer.
///
/// # Errors
/// The refusal, or the last failure when patience ends.
pub(crate) async fn answered<T, F>(mut call: impl FnMut() -> F) -> Result<T, Status>
where
    F: Future<Output = Result<Response<T>, Status>>,
{
    let began = Instant::now();
    loop {
        let failure = match tokio::time::timeout(ANSWER, call()).await {
            Ok(Ok(answer)) => return Ok(answer.into_inner()),
            Ok(Err(status)) if !is_transient(status.code()) => return Err(status),
            Ok(Err(status)) => status,
            Err(_) => Status::deadline_exceeded("no answer in time"),
        };
        if began.elapsed() > PATIENCE {
            return Err(failure);
        }
        tokio::time::sleep(PAUSE).await;
    }
}

/// Whether a broken connection or an end of the coordinator can cause this failure.
pub(crate) fn is_transient(code: Code) -> bool {
    failure_cause(code) == FailureCause::Connection
}

/// A client of the service.
#[derive(Debug, Clone)]
pub(crate) struct Calls(Channel);

impl Calls {
    /// A client of the coordinators at `addresses`, which need not run yet.
    ///
    /// # Errors
    /// When there is no address.
    pub(crate) fn to(addresses: &[SocketAddr]) -> Result<Self> {
        let addresses: Vec<String> = addresses.iter().map(SocketAddr::to_string).collect();
        let service = Addresses::parse(&addresses.join(",")).context("the addresses")?;
        Ok(Self(service.connect_lazy()))
    }

    /// The connection.
    pub(crate) fn channel(&self) -> Channel {
        self.0.clone()
    }

    fn jobs(&self) -> JobServiceClient<Channel> {
        JobServiceClient::new(self.channel())
    }

    fn models(&self) -> ModelServiceClient<Channel> {
        ModelServiceClient::new(self.channel())
    }

    fn subjects(&self) -> SubjectServiceClient<Channel> {
        SubjectServiceClient::new(self.channel())
    }

    /// The worker's side of the service.
    pub(crate) fn workers(&self) -> WorkerServiceClient<Channel> {
        WorkerServiceClient::new(self.channel())
    }

    /// Whether the service reports that it is healthy; `None` if it does not answer.
    pub(crate) async fn health(&self) -> Option<bool> {
        let mut service = HealthClient::new(self.channel());
        let asked = service.check(HealthCheckRequest::default());
        let answer = tokio::time::timeout(ANSWER, asked).await.ok()?.ok()?;
        Some(answer.get_ref().status() == ServingStatus::Serving)
    }

    /// Whether the service answers a question to its database, once and within `limit`.
    pub(crate) async fn answers(&self, limit: Duration) -> bool {
        let request = GetJobRequest {
            name: "jobs/none".to_owned(),
        };
        let mut service = self.jobs();
        let asked = tokio::time::timeout(limit, service.get_job(request)).await;
        matches!(asked, Ok(Err(status)) if status.code() == Code::NotFound)
    }

    /// Creates a person and returns its name.
    ///
    /// # Errors
    /// When the service refuses.
    pub(crate) async fn create_subject(&self, display_name: &str) -> Result<String> {
        let request = CreateSubjectRequest {
            display_name: display_name.to_owned(),
            consent_note: "made up".to_owned(),
            request_id: uuid::Uuid::new_v4().to_string(),
            validate_only: false,
        };
        let call = || {
            let (mut service, request) = (self.subjects(), request.clone());
            async move { service.create_subject(request).await }
        };
        Ok(answered(call).await.context("creating a subject")?.name)
    }

    /// Creates a model of `subjects` and returns its name.
    ///
    /// # Errors
    /// When the service refuses.
    pub(crate) async fn create_model(
        &self,
        display_name: &str,
        subjects: &[String],
    ) -> Result<String> {
        let request = CreateModelRequest {
            display_name: display_name.to_owned(),
            tier: "draft".to_owned(),
            variant: "yoto".to_owned(),
            request_id: uuid::Uuid::new_v4().to_string(),
            retention: None,
            validate_only: false,
        };
        let call = || {
            let (mut service, request) = (self.models(), request.clone());
            async move { service.create_model(request).await }
        };
        let model = answered(call).await.context("creating a model")?.name;
        for subject in subjects {
            let request = AddIdentityRequest {
                request_id: String::new(),
                model: model.clone(),
                subject: subject.clone(),
            };
            let call = || {
                let (mut service, request) = (self.models(), request.clone());
                async move { service.add_identity(request).await }
            };
            match answered(call).await {
                // An earlier delivery was carried out, and its answer lost.
                Err(status) if status.code() == Code::AlreadyExists => {}
                other => drop(other.context("adding an identity")?),
            }
        }
        Ok(model)
    }

    /// Creates a job; the same request has the same answer.
    ///
    /// # Errors
    /// When the service refuses.
    pub(crate) async fn create_job(&self, request: &CreateJobRequest) -> Result<Job, Status> {
        answered(|| {
            let (mut service, request) = (self.jobs(), request.clone());
            async move { service.create_job(request).await }
        })
        .await
    }

    /// A job with its history.
    ///
    /// # Errors
    /// When the service refuses.
    pub(crate) async fn job(&self, name: &str) -> Result<Job, Status> {
        let request = GetJobRequest {
            name: name.to_owned(),
        };
        answered(|| {
            let (mut service, request) = (self.jobs(), request.clone());
            async move { service.get_job(request).await }
        })
        .await
    }

    /// All jobs in one of the `states`; all jobs without any.
    ///
    /// # Errors
    /// When the service refuses.
    pub(crate) async fn list_jobs(&self, states: &[job::State]) -> Result<Vec<Job>, Status> {
        let (mut jobs, mut page_token) = (Vec::new(), String::new());
        loop {
            let request = ListJobsRequest {
                page_size: 1000,
                page_token,
                states: states.iter().map(|&state| state.into()).collect(),
                ..ListJobsRequest::default()
            };
            let page = answered(|| {
                let (mut service, request) = (self.jobs(), request.clone());
                async move { service.list_jobs(request).await }
            })
            .await?;
            jobs.extend(page.jobs);
            page_token = page.next_page_token;
            if page_token.is_empty() {
                return Ok(jobs);
            }
        }
    }

    /// Cancels a job.
    ///
    /// # Errors
    /// When the service refuses.
    pub(crate) async fn cancel_job(&self, name: &str) -> Result<Job, Status> {
        let request = CancelJobRequest {
            name: name.to_owned(),
            request_id: uuid::Uuid::new_v4().to_string(),
        };
        answered(|| {
            let (mut service, request) = (self.jobs(), request.clone());
            async move { service.cancel_job(request).await }
        })
        .await
    }

    /// Deletes a job. NOT_FOUND counts as success: an earlier delivery deleted it.
    ///
    /// # Errors
    /// When the service refuses.
    pub(crate) async fn delete_job(&self, name: &str) -> Result<(), Status> {
        let request = DeleteJobRequest {
            name: name.to_owned(),
            ..DeleteJobRequest::default()
        };
        let deleted = answered(|| {
            let (mut service, request) = (self.jobs(), request.clone());
            async move { service.delete_job(request).await }
        });
        match deleted.await {
            Err(status) if status.code() != Code::NotFound => Err(status),
            _ => Ok(()),
        }
    }

    /// A capture.
    ///
    /// # Errors
    /// When the service refuses.
    pub(crate) async fn capture(&self, name: &str) -> Result<Capture, Status> {
        let request = GetCaptureRequest {
            name: name.to_owned(),
        };
        answered(|| {
            let (mut service, request) = (self.subjects(), request.clone());
            async move { service.get_capture(request).await }
        })
        .await
    }

    /// The checkpoints of a model, newest first.
    ///
    /// # Errors
    /// When the service refuses.
    pub(crate) async fn checkpoints(&self, model: &str) -> Result<Vec<Checkpoint>, Status> {
        let request = ListCheckpointsRequest {
            model: model.to_owned(),
            page_size: 1000,
            page_token: String::new(),
        };
        let listed = answered(|| {
            let (mut service, request) = (self.models(), request.clone());
            async move { service.list_checkpoints(request).await }
        });
        Ok(listed.await?.checkpoints)
    }

    /// Starts to watch a job.
    ///
    /// # Errors
    /// When the service refuses.
    pub(crate) async fn watch(
        &self,
        name: &str,
    ) -> Result<tonic::Streaming<WatchJobResponse>, Status> {
        let request = WatchJobRequest {
            name: name.to_owned(),
            after_sequence: 0,
        };
        answered(|| {
            let (mut service, request) = (self.jobs(), request.clone());
            async move { service.watch_job(request).await }
        })
        .await
    }
}
