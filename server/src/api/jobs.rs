//! `yoto.v1.JobService`.

use super::{fields, paging};
use crate::{
    context::Context,
    error::RequestError,
    jobs::{queue, watch},
    store::Target,
};
use futures::{StreamExt, TryStreamExt, stream::BoxStream};
use std::sync::Arc;
use tokio_util::sync::CancellationToken;
use tonic::{Request, Response, Status};
use yoto_proto::{
    names::Collection,
    v1::{
        CancelJobRequest, CreateJobRequest, DeleteJobRequest, Deleted, GetJobRequest, Job,
        ListJobsRequest, ListJobsResponse, WatchJobRequest, WatchJobResponse, job,
        job_service_server::JobService,
    },
};

/// The states with these numbers. An unknown one would match no job, and so look like an empty queue.
fn states(numbers: &[i32]) -> Result<Vec<job::State>, RequestError> {
    let known = |number: &i32| {
        let state = job::State::try_from(*number).ok();
        let state = state.filter(|state| *state != job::State::Unspecified);
        state.ok_or_else(|| RequestError::invalid("states", format!("{number} is not a state")))
    };
    numbers.iter().map(known).collect()
}

/// Jobs for the workers, and their progress.
pub struct JobApi {
    /// The shared parts.
    pub context: Arc<Context>,
    /// Ends the watch streams, which would otherwise delay a shutdown.
    pub drain: CancellationToken,
}

#[tonic::async_trait]
impl JobService for JobApi {
    async fn create_job(
        &self,
        request: Request<CreateJobRequest>,
    ) -> Result<Response<Job>, Status> {
        let request = request.into_inner();
        let key = fields::request_key("CreateJob", &request.request_id, &request)?;
        let spec = request.spec.unwrap_or_default();
        Ok(Response::new(
            queue::create(&self.context, spec, key).await?,
        ))
    }

    async fn get_job(&self, request: Request<GetJobRequest>) -> Result<Response<Job>, Status> {
        let id = fields::id(Collection::Jobs, "name", &request.get_ref().name)?;
        let job = self.context.store.job(&id).await;
        Ok(Response::new(job.map_err(RequestError::from)?))
    }

    async fn list_jobs(
        &self,
        request: Request<ListJobsRequest>,
    ) -> Result<Response<ListJobsResponse>, Status> {
        let request = request.get_ref();
        let page = paging::Request::read("jobs", request.page_size, &request.page_token)?;
        let states = states(&request.states)?;
        let entries = self.context.store.jobs(page.page(), &states).await;
        let (jobs, next_page_token) = page.cut(entries.map_err(RequestError::from)?);
        Ok(Response::new(ListJobsResponse {
            jobs,
            next_page_token,
        }))
    }

    async fn cancel_job(
        &self,
        request: Request<CancelJobRequest>,
    ) -> Result<Response<Job>, Status> {
        let id = fields::id(Collection::Jobs, "name", &request.get_ref().name)?;
        Ok(Response::new(queue::cancel(&self.context, &id).await?))
    }

    async fn delete_job(
        &self,
        request: Request<DeleteJobRequest>,
    ) -> Result<Response<Deleted>, Status> {
        let request = request.get_ref();
        let key = fields::request_key("DeleteJob", &request.request_id, request)?;
        let id = fields::id(Collection::Jobs, "name", &request.name)?;
        let deleted = self.context.store.delete(Target::Job(&id), key).await;
        Ok(Response::new(deleted.map_err(RequestError::from)?))
    }

    type WatchJobStream = BoxStream<'static, Result<WatchJobResponse, Status>>;

    async fn watch_job(
        &self,
        request: Request<WatchJobRequest>,
    ) -> Result<Response<Self::WatchJobStream>, Status> {
        let request = request.get_ref();
        let id = fields::id(Collection::Jobs, "name", &request.name)?;
        // An unknown job is answered at once, not as the first item of a stream.
        self.context
            .store
            .job(&id)
            .await
            .map_err(RequestError::from)?;
        let context = Arc::clone(&self.context);
        let jobs = watch::watch(context, id, request.after_sequence, self.drain.clone());
        let answers = jobs.map_ok(|job| WatchJobResponse { job: Some(job) });
        Ok(Response::new(answers.map_err(Status::from).boxed()))
    }
}
