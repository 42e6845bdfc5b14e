//! Jobs: creation, progress and results.

use super::retry::{read, repeat};
use super::{ClientError, JobWatch, YotoClient, request_id};
use yoto_proto::key::Connection;
use yoto_proto::limits::ANSWER_BYTES;
use yoto_proto::v1::job_service_client::JobServiceClient;
use yoto_proto::v1::{
    CancelJobRequest, CreateJobRequest, DeleteJobRequest, Deleted, EvaluateSpec, ExportSpec,
    GetJobMetricsRequest, GetJobRequest, IngestSpec, Job, JobKind, JobSpec, JobView,
    ListJobsRequest, MetricPoint, PauseJobsRequest, RenderSpec, ResumeJobsRequest, RetryJobRequest,
    TrainSpec, job, job_spec,
};

impl YotoClient {
    pub(super) fn job_service(&self) -> JobServiceClient<Connection> {
        JobServiceClient::new(self.channel.clone()).max_decoding_message_size(ANSWER_BYTES)
    }

    /// Queues a job.
    ///
    /// # Errors
    /// [`ClientError::Refused`] with the faulty fields of the spec.
    pub async fn create_job(&self, kind: job_spec::Kind) -> Result<Job, ClientError> {
        let doing = format!("creating {} job", kind_with_article(&kind));
        let request = CreateJobRequest {
            spec: Some(JobSpec { kind: Some(kind) }),
            request_id: request_id(),
            priority: self.queue.priority.into(),
            owner: self.queue.owner.clone(),
            validate_only: false,
        };
        let create = || {
            let (mut service, request) = (self.job_service(), request.clone());
            async move { service.create_job(request).await }
        };
        repeat(create).await.map_err(ClientError::refused(doing))
    }

    /// Checks an order as [`create_job`](Self::create_job) does, without queueing it.
    ///
    /// # Errors
    /// As [`create_job`](Self::create_job).
    pub async fn validate_job(&self, kind: job_spec::Kind) -> Result<Job, ClientError> {
        let doing = format!("checking {} job", kind_with_article(&kind));
        let request = CreateJobRequest {
            spec: Some(JobSpec { kind: Some(kind) }),
            priority: self.queue.priority.into(),
            owner: self.queue.owner.clone(),
            validate_only: true,
            ..CreateJobRequest::default()
        };
        let check = || {
            let (mut service, request) = (self.job_service(), request.clone());
            async move { service.create_job(request).await }
        };
        repeat(check).await.map_err(ClientError::refused(doing))
    }

    /// Queues training.
    ///
    /// # Errors
    /// As [`create_job`](Self::create_job).
    pub async fn train(&self, spec: TrainSpec) -> Result<Job, ClientError> {
        self.create_job(job_spec::Kind::Train(spec)).await
    }

    /// Queues an evaluation.
    ///
    /// # Errors
    /// As [`create_job`](Self::create_job); e.g. for a model without a checkpoint.
    pub async fn evaluate(&self, spec: EvaluateSpec) -> Result<Job, ClientError> {
        self.create_job(job_spec::Kind::Evaluate(spec)).await
    }

    /// Queues an export.
    ///
    /// # Errors
    /// As [`create_job`](Self::create_job); e.g. for a person that the model does not have.
    pub async fn export(&self, spec: ExportSpec) -> Result<Job, ClientError> {
        self.create_job(job_spec::Kind::Export(spec)).await
    }

    /// The current state of the job `name`.
    ///
    /// # Errors
    /// [`ClientError::Refused`] when no job has this name.
    pub async fn get_job(&self, name: &str) -> Result<Job, ClientError> {
        let get = || {
            let (mut service, name) = (self.job_service(), name.to_owned());
            async move { service.get_job(GetJobRequest { name }).await }
        };
        let found = read(get).await;
        found.map_err(ClientError::refused(format!("reading {name}")))
    }

    /// Every job, newest first, over all pages.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn list_jobs(&self) -> Result<Vec<Job>, ClientError> {
        self.list_jobs_in(&[], usize::MAX).await
    }

    /// The newest jobs in one of `states` (in any if empty), at most `limit`.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn list_jobs_in(
        &self,
        states: &[job::State],
        limit: usize,
    ) -> Result<Vec<Job>, ClientError> {
        let service = self.job_service();
        let (mut jobs, mut page_token) = (Vec::new(), String::new());
        loop {
            let request = ListJobsRequest {
                page_size: (limit - jobs.len()).min(1000) as i32,
                page_token,
                states: states.iter().map(|&state| state.into()).collect(),
                view: JobView::Full.into(),
                ..ListJobsRequest::default()
            };
            let list = || {
                let (mut service, request) = (service.clone(), request.clone());
                async move { service.list_jobs(request).await }
            };
            let page = read(list).await;
            let page = page.map_err(ClientError::refused("listing jobs"))?;
            jobs.extend(page.jobs);
            page_token = page.next_page_token;
            if page_token.is_empty() || jobs.len() >= limit {
                jobs.truncate(limit);
                return Ok(jobs);
            }
        }
    }

    /// Cancels a job. A running job ends after its worker's next heartbeat.
    ///
    /// # Errors
    /// [`ClientError::Refused`], e.g. when there is no such job.
    pub async fn cancel_job(&self, name: &str) -> Result<Job, ClientError> {
        let request = CancelJobRequest {
            name: name.to_owned(),
            request_id: request_id(),
        };
        let cancel = || {
            let (mut service, request) = (self.job_service(), request.clone());
            async move { service.cancel_job(request).await }
        };
        let doing = format!("cancelling {name}");
        repeat(cancel).await.map_err(ClientError::refused(doing))
    }

    /// The figures of the job `name` over its steps.
    ///
    /// # Errors
    /// [`ClientError::Refused`] when no job has this name.
    pub async fn job_metrics(&self, name: &str) -> Result<Vec<MetricPoint>, ClientError> {
        let read = || {
            let mut service = self.job_service();
            let name = name.to_owned();
            async move { service.get_job_metrics(GetJobMetricsRequest { name }).await }
        };
        let doing = format!("reading the figures of {name}");
        let metrics = repeat(read).await.map_err(ClientError::refused(doing))?;
        Ok(metrics.points)
    }

    /// Queues the order of a job that failed or was cancelled as a new job.
    ///
    /// # Errors
    /// [`ClientError::Refused`], e.g. for a job that has succeeded or is still open.
    pub async fn retry_job(&self, name: &str) -> Result<Job, ClientError> {
        let request = RetryJobRequest {
            name: name.to_owned(),
            request_id: request_id(),
        };
        let retry = || {
            let (mut service, request) = (self.job_service(), request.clone());
            async move { service.retry_job(request).await }
        };
        let doing = format!("queueing {name} again");
        repeat(retry).await.map_err(ClientError::refused(doing))
    }

    /// Stops the leasing of a kind of jobs, for a reason; running jobs continue.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn pause_jobs(&self, kind: JobKind, reason: &str) -> Result<(), ClientError> {
        let request = PauseJobsRequest {
            kind: kind.into(),
            reason: reason.to_owned(),
        };
        let pause = || {
            let (mut service, request) = (self.job_service(), request.clone());
            async move { service.pause_jobs(request).await }
        };
        let paused = repeat(pause).await.map(drop);
        paused.map_err(ClientError::refused("pausing jobs"))
    }

    /// Ends the pause of a kind of jobs.
    ///
    /// # Errors
    /// [`ClientError::Refused`].
    pub async fn resume_jobs(&self, kind: JobKind) -> Result<(), ClientError> {
        let request = ResumeJobsRequest { kind: kind.into() };
        let resume = || {
            let mut service = self.job_service();
            async move { service.resume_jobs(request).await }
        };
        let resumed = repeat(resume).await.map(drop);
        resumed.map_err(ClientError::refused("resuming jobs"))
    }

    /// Deletes a job that has ended, with its pictures and figures, if its version is still `etag`; an
    /// empty `etag` accepts any version.
    ///
    /// # Errors
    /// [`ClientError::Refused`], e.g. while it is queued or running.
    pub async fn delete_job(&self, name: &str, etag: &str) -> Result<Deleted, ClientError> {
        let request = DeleteJobRequest {
            name: name.to_owned(),
            request_id: request_id(),
            etag: etag.to_owned(),
        };
        let delete = || {
            let (mut service, request) = (self.job_service(), request.clone());
            async move { service.delete_job(request).await }
        };
        let doing = format!("deleting {name}");
        repeat(delete).await.map_err(ClientError::refused(doing))
    }

    /// Follows a job from its current state to its end.
    pub fn watch_job(&self, name: &str) -> JobWatch {
        JobWatch::new(self.clone(), name)
    }

    /// Follows a job to its end, and calls `on_change` with every change.
    ///
    /// # Errors
    /// [`ClientError::JobEnded`] when it failed or was cancelled; otherwise as
    /// [`JobWatch::next`].
    pub async fn wait_for_job(
        &self,
        name: &str,
        mut on_change: impl FnMut(&Job),
    ) -> Result<Job, ClientError> {
        let mut watch = self.watch_job(name);
        let mut last = None;
        while let Some(job) = watch.next().await? {
            on_change(&job);
            last = Some(job);
        }
        Self::succeeded(name, last)
    }

    /// The `last` state of the job `name` that was seen, if it is a success.
    ///
    /// # Errors
    /// [`ClientError::JobEnded`] when it failed or was cancelled.
    pub fn succeeded(name: &str, last: Option<Job>) -> Result<Job, ClientError> {
        let job =
            last.ok_or_else(|| ClientError::Contract(format!("watching {name} showed no job")))?;
        if job.state() == job::State::Succeeded {
            Ok(job)
        } else {
            Err(ClientError::JobEnded(Box::new(job)))
        }
    }
}

/// "an ingest", "a train", …: for messages.
fn kind_with_article(kind: &job_spec::Kind) -> &'static str {
    match kind {
        job_spec::Kind::Ingest(IngestSpec { .. }) => "an ingest",
        job_spec::Kind::Train(TrainSpec { .. }) => "a train",
        job_spec::Kind::Render(RenderSpec { .. }) => "a render",
        job_spec::Kind::Evaluate(EvaluateSpec { .. }) => "an evaluate",
        job_spec::Kind::Export(ExportSpec { .. }) => "an export",
    }
}
