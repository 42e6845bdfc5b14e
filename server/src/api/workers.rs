//! `yoto.v1.WorkerService`.

use super::{fields, worker_text};
use crate::{
    context::Context,
    error::RequestError,
    jobs::{lease, report},
    store::{Ending, JobKind, LeaseKey, NewWorker},
};
use std::sync::Arc;
use tokio_util::sync::CancellationToken;
use tonic::{Request, Response, Status};
use yoto_proto::{
    names::Collection,
    v1::{
        CompleteJobRequest, CompleteJobResponse, FailJobRequest, FailJobResponse, HeartbeatRequest,
        HeartbeatResponse, LeaseJobRequest, LeaseJobResponse, PublishCheckpointRequest,
        PublishCheckpointResponse, RegisterWorkerRequest, RegisterWorkerResponse,
        worker_service_server::WorkerService,
    },
};

/// The workers' side of the coordinator.
pub struct WorkerApi {
    /// The shared parts.
    pub context: Arc<Context>,
    /// Once cancelled, there are no new leases; running jobs may still report.
    pub drain: CancellationToken,
}

fn lease_key(job: &str, token: u64) -> Result<LeaseKey, RequestError> {
    Ok(LeaseKey {
        job_id: fields::id(Collection::Jobs, "job", job)?,
        token,
    })
}

#[tonic::async_trait]
impl WorkerService for WorkerApi {
    async fn register_worker(
        &self,
        request: Request<RegisterWorkerRequest>,
    ) -> Result<Response<RegisterWorkerResponse>, Status> {
        let request = request.into_inner();
        let mut kinds = Vec::with_capacity(request.kinds.len());
        for kind in &request.kinds {
            let shown: String = kind.chars().take(80).collect();
            kinds.push(JobKind::parse(kind).ok_or_else(|| {
                RequestError::invalid("kinds", format!("'{shown}' is not a kind of job"))
            })?);
        }
        if kinds.is_empty() {
            return Err(RequestError::invalid("kinds", "a worker needs at least one kind").into());
        }
        let device = request.device.map(worker_text::device);
        let device = device.ok_or_else(|| RequestError::invalid("device", "is missing"))?;
        let display_name = fields::display_name(&request.display_name)?;
        let new = NewWorker {
            display_name,
            device,
            kinds,
        };
        let id = lease::register(&self.context, new).await?;
        Ok(Response::new(RegisterWorkerResponse {
            worker: Collection::Workers.name(&id),
            lease_seconds: self.context.config.lease_seconds,
        }))
    }

    async fn lease_job(
        &self,
        request: Request<LeaseJobRequest>,
    ) -> Result<Response<LeaseJobResponse>, Status> {
        let id = fields::id(Collection::Workers, "worker", &request.get_ref().worker)?;
        if self.drain.is_cancelled() {
            return Err(RequestError::ShuttingDown.into());
        }
        let lease = lease::lease(&self.context, &id).await?;
        Ok(Response::new(LeaseJobResponse { lease }))
    }

    async fn heartbeat(
        &self,
        request: Request<HeartbeatRequest>,
    ) -> Result<Response<HeartbeatResponse>, Status> {
        let request = request.into_inner();
        let key = lease_key(&request.job, request.token)?;
        let cancel = report::heartbeat(&self.context, &key, request.progress).await?;
        let lease_seconds = self.context.config.lease_seconds;
        Ok(Response::new(HeartbeatResponse {
            cancel,
            lease_seconds,
        }))
    }

    async fn publish_checkpoint(
        &self,
        request: Request<PublishCheckpointRequest>,
    ) -> Result<Response<PublishCheckpointResponse>, Status> {
        let request = request.into_inner();
        let key = lease_key(&request.job, request.token)?;
        let checkpoint = request.checkpoint;
        let checkpoint =
            checkpoint.ok_or_else(|| RequestError::invalid("checkpoint", "is missing"))?;
        report::publish(&self.context, &key, checkpoint).await?;
        Ok(Response::new(PublishCheckpointResponse {}))
    }

    async fn complete_job(
        &self,
        request: Request<CompleteJobRequest>,
    ) -> Result<Response<CompleteJobResponse>, Status> {
        let request = request.into_inner();
        let key = lease_key(&request.job, request.token)?;
        let result = request.result.unwrap_or_default();
        report::complete(&self.context, &key, result).await?;
        Ok(Response::new(CompleteJobResponse {}))
    }

    async fn fail_job(
        &self,
        request: Request<FailJobRequest>,
    ) -> Result<Response<FailJobResponse>, Status> {
        let request = request.into_inner();
        let key = lease_key(&request.job, request.token)?;
        let error = request.error.map(worker_text::error);
        let ending = match (request.cancelled, request.requeue, error) {
            (true, true, _) => {
                let message = "a job is either cancelled or requeued";
                return Err(RequestError::invalid("requeue", message).into());
            }
            (true, false, _) => Ending::Cancelled,
            (false, true, Some(error)) if !error.code.is_empty() => Ending::TryLater(error),
            (false, true, _) => Ending::Requeued,
            (false, false, Some(error)) if !error.code.is_empty() => Ending::Failed(error),
            (false, false, _) => {
                return Err(RequestError::invalid("error", "a failure needs a code").into());
            }
        };
        report::end(&self.context, &key, ending).await?;
        Ok(Response::new(FailJobResponse {}))
    }
}
