//! `yoto.v1.JobService`.

use super::orders::{Order, order_job};
use super::{fields, paging, public};
use crate::context::Context;
use crate::jobs::{queue, retry, watch, watch_all};
use futures::stream::BoxStream;
use futures::{StreamExt, TryStreamExt};
use std::collections::HashMap;
use std::sync::Arc;
use tokio_util::sync::CancellationToken;
use tonic::{Request, Response, Status};
use yoto_proto::limits::{LONGEST_PAGE_ENTRIES, REASON_CHARACTERS};
use yoto_proto::names::Collection;
use yoto_proto::v1::job_service_server::JobService;
use yoto_proto::v1::{
    CancelJobRequest, CreateJobRequest, DeleteJobRequest, Deleted, GetJobMetricsRequest,
    GetJobRequest, Job, JobMetrics, JobView, ListJobsRequest, ListJobsResponse, PauseJobsRequest,
    PauseJobsResponse, ResumeJobsRequest, ResumeJobsResponse, RetryJobRequest, WatchJobRequest,
    WatchJobResponse, WatchJobsRequest, WatchJobsResponse, job,
};
use yoto_request::validation::{all, both};
use yoto_request::{Caller, RequestError, tenant_of, trace_parent_of};
use yoto_store::Tenant;

use yoto_store::{JobFilter, Target};

/// The states with these numbers. An unknown number is refused: it would match no job, and look like an empty
/// queue.
fn states(numbers: &[i32]) -> Result<Vec<job::State>, RequestError> {
    let known = |number: &i32| {
        let state = job::State::try_from(*number).ok();
        let state = state.filter(|state| *state != job::State::Unspecified);
        state.ok_or_else(|| RequestError::invalid("states", format!("{number} is not a state")))
    };
    let mut states = all(numbers.iter().map(known))?;
    // Each is a parameter of a statement, of which databases take a limited number.
    states.sort_unstable();
    states.dedup();
    Ok(states)
}

/// The jobs of these kinds, of this model and of this owner; an empty value: of all.
fn filter(kinds: &[i32], model: &str, owner: &str) -> Result<JobFilter, RequestError> {
    let model_id = match model {
        "" => Ok(None),
        model => fields::id(Collection::Models, "model", model).map(Some),
    };
    let owner = fields::line("owner", owner, usize::MAX);
    let kinds = fields::job_kinds("kinds", kinds);
    let ((kinds, model_id), owner) = both(both(kinds, model_id), owner)?;
    Ok(JobFilter {
        states: Vec::new(),
        kinds,
        model_id,
        owner: (!owner.is_empty()).then_some(owner),
    })
}

/// Jobs for the workers, and their progress.
pub(crate) struct JobApi {
    /// The shared parts.
    pub context: Arc<Context>,
    /// Ends the watch streams, which would otherwise delay a shutdown.
    pub drain: CancellationToken,
}

impl JobApi {
    /// Refuses a filter with a model that does not exist: it would match no job, and look like an empty queue.
    async fn require_model(&self, tenant: &Tenant, filter: &JobFilter) -> Result<(), RequestError> {
        if let Some(id) = &filter.model_id {
            self.context.store.require_model(tenant, id).await?;
        }
        Ok(())
    }
}

#[tonic::async_trait]
impl JobService for JobApi {
    async fn create_job(
        &self,
        request: Request<CreateJobRequest>,
    ) -> Result<Response<Job>, Status> {
        let tenant = tenant_of(&request)?;
        let trace_parent = trace_parent_of(&request);
        let request = request.into_inner();
        let order = Order {
            key: fields::request_key("CreateJob", &request.request_id, &request),
            spec: request.spec.unwrap_or_default(),
            priority: request.priority,
            owner: request.owner,
            validate_only: request.validate_only,
            trace_parent,
        };
        let job = order_job(&self.context, &tenant, order).await?;
        Ok(Response::new(job))
    }

    async fn get_job(&self, request: Request<GetJobRequest>) -> Result<Response<Job>, Status> {
        let tenant = tenant_of(&request)?;
        let id = fields::id(Collection::Jobs, "name", &request.get_ref().name)?;
        let job = self.context.store.job_history(&tenant, &id).await;
        Ok(Response::new(public::job(job.map_err(RequestError::from)?)))
    }

    async fn list_jobs(
        &self,
        request: Request<ListJobsRequest>,
    ) -> Result<Response<ListJobsResponse>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.get_ref();
        let rest = ListJobsRequest {
            page_size: 0,
            page_token: String::new(),
            ..request.clone()
        };
        let page = paging::Request::read("jobs", request.page_size, &request.page_token, &rest);
        let of_states = both(page, states(&request.states));
        let filter = filter(&request.kinds, &request.model, &request.owner);
        let view = JobView::try_from(request.view);
        let view = view.map_err(|error| RequestError::invalid("view", error.to_string()));
        let ((page, states), (filter, view)) = both(of_states, both(filter, view))?;
        self.require_model(&tenant, &filter).await?;
        let filter = JobFilter { states, ..filter };
        let full = view == JobView::Full;
        let entries = self
            .context
            .store
            .jobs(&tenant, page.page(), &filter, full)
            .await;
        let (jobs, next_page_token) = page.cut(entries.map_err(RequestError::from)?);
        Ok(Response::new(ListJobsResponse {
            jobs: jobs.into_iter().map(public::job).collect(),
            next_page_token,
        }))
    }

    async fn cancel_job(
        &self,
        request: Request<CancelJobRequest>,
    ) -> Result<Response<Job>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.get_ref();
        let key = fields::request_key("CancelJob", &request.request_id, request)?;
        let id = fields::id(Collection::Jobs, "name", &request.name)?;
        let job = queue::cancel(&self.context, &tenant, &id, key).await?;
        Ok(Response::new(public::job(job)))
    }

    async fn pause_jobs(
        &self,
        request: Request<PauseJobsRequest>,
    ) -> Result<Response<PauseJobsResponse>, Status> {
        let caller = Caller::of(&request)?;
        let request = request.get_ref();
        let kind = fields::job_kind("kind", request.kind);
        let reason = fields::line("reason", &request.reason, REASON_CHARACTERS);
        let (kind, reason) = both(kind, reason)?;
        let note = fields::note(&reason, &caller);
        let store = &self.context.store;
        let paused = store.pause_jobs(caller.own_tenant(), kind, note).await;
        paused.map_err(RequestError::from)?;
        tracing::info!(kind = kind.as_str(), "jobs paused");
        Ok(Response::new(PauseJobsResponse {}))
    }

    async fn resume_jobs(
        &self,
        request: Request<ResumeJobsRequest>,
    ) -> Result<Response<ResumeJobsResponse>, Status> {
        let tenant = tenant_of(&request)?;
        let kind = fields::job_kind("kind", request.get_ref().kind)?;
        let resumed = self.context.store.resume_jobs(&tenant, kind).await;
        resumed.map_err(RequestError::from)?;
        self.context.notifier.queued(&tenant, kind);
        tracing::info!(kind = kind.as_str(), "jobs resumed");
        Ok(Response::new(ResumeJobsResponse {}))
    }

    async fn delete_job(
        &self,
        request: Request<DeleteJobRequest>,
    ) -> Result<Response<Deleted>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.get_ref();
        let key = fields::request_key("DeleteJob", &request.request_id, request)?;
        let id = fields::id(Collection::Jobs, "name", &request.name)?;
        let deleted = (self.context.store)
            .delete(&tenant, Target::Job(&id), &request.etag, key)
            .await;
        Ok(Response::new(deleted.map_err(RequestError::from)?))
    }

    type WatchJobStream = BoxStream<'static, Result<WatchJobResponse, Status>>;

    async fn watch_job(
        &self,
        request: Request<WatchJobRequest>,
    ) -> Result<Response<Self::WatchJobStream>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.get_ref();
        let id = fields::id(Collection::Jobs, "name", &request.name)?;
        // An unknown job is answered at once, not as the first item of a stream.
        self.context
            .store
            .job_state(&tenant, &id)
            .await
            .map_err(RequestError::from)?;
        let context = Arc::clone(&self.context);
        let jobs = watch::watch(
            context,
            tenant,
            id,
            request.after_sequence,
            self.drain.clone(),
        );
        let answers = jobs.map_ok(|job| WatchJobResponse {
            job: Some(public::job(job)),
        });
        Ok(Response::new(answers.map_err(Status::from).boxed()))
    }

    type WatchJobsStream = BoxStream<'static, Result<WatchJobsResponse, Status>>;

    async fn watch_jobs(
        &self,
        request: Request<WatchJobsRequest>,
    ) -> Result<Response<Self::WatchJobsStream>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.into_inner();
        let filter = filter(&request.kinds, &request.model, &request.owner)?;
        self.require_model(&tenant, &filter).await?;
        if request.known.len() > LONGEST_PAGE_ENTRIES as usize {
            let message = format!("at most {LONGEST_PAGE_ENTRIES} jobs are allowed");
            return Err(RequestError::invalid("known", message).into());
        }
        let mut known = HashMap::new();
        for (index, job) in request.known.into_iter().enumerate() {
            fields::id(Collection::Jobs, &format!("known[{index}].name"), &job.name)?;
            known.insert(job.name, job.sequence);
        }
        let context = Arc::clone(&self.context);
        let answers = watch_all::watch_all(context, tenant, filter, known, self.drain.clone());
        let answers = answers.map_ok(|answer| WatchJobsResponse {
            jobs: answer.jobs.into_iter().map(public::job).collect(),
            ..answer
        });
        Ok(Response::new(answers.map_err(Status::from).boxed()))
    }

    async fn get_job_metrics(
        &self,
        request: Request<GetJobMetricsRequest>,
    ) -> Result<Response<JobMetrics>, Status> {
        let tenant = tenant_of(&request)?;
        let id = fields::id(Collection::Jobs, "name", &request.get_ref().name)?;
        let metrics = self.context.store.job_metrics(&tenant, &id).await;
        Ok(Response::new(metrics.map_err(RequestError::from)?))
    }

    async fn retry_job(&self, request: Request<RetryJobRequest>) -> Result<Response<Job>, Status> {
        let tenant = tenant_of(&request)?;
        let trace_parent = trace_parent_of(&request);
        let request = request.get_ref();
        let key = fields::request_key("RetryJob", &request.request_id, request)?;
        let id = fields::id(Collection::Jobs, "name", &request.name)?;
        let job = retry::retry(&self.context, &tenant, &id, key, trace_parent).await?;
        Ok(Response::new(public::job(job)))
    }
}
