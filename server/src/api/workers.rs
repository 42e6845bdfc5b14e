//! `yoto.worker.v1.WorkerService`.

use super::{fields, worker_text};
use crate::context::Context;
use crate::jobs::{lease, report};
use crate::notify::hints::Busy;
use crate::traffic::Client;
use std::collections::HashSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio_util::sync::CancellationToken;
use tonic::{Request, Response, Status};
use yoto_proto::names::Collection;
use yoto_proto::orders;
use yoto_proto::v1::JobError;
use yoto_proto::worker::v1::end_job_request::Outcome;
use yoto_proto::worker::v1::worker_service_server::WorkerService;
use yoto_proto::worker::v1::{
    Claim, CommitOutputRequest, CommitOutputResponse, EndJobRequest, EndJobResponse,
    HeartbeatRequest, HeartbeatResponse, LeaseJobRequest, LeaseJobResponse,
    PublishCheckpointRequest, PublishCheckpointResponse, RegisterWorkerRequest,
    RegisterWorkerResponse, TakeRangeRequest, TakeRangeResponse, WaitForJobRequest,
    WaitForJobResponse,
};
use yoto_request::validation::both;
use yoto_request::{Caller, RequestError, tenant_of};
use yoto_store::{Ending, LeaseKey, NewWorker, Tenant};

/// Longest wait for a job.
const LONGEST_WAIT: Duration = Duration::from_secs(10);

/// The workers' side of the coordinator.
pub(crate) struct WorkerApi {
    /// The shared parts.
    pub context: Arc<Context>,
    /// Once cancelled, no new leases are given; running jobs may still report.
    pub drain: CancellationToken,
    /// Workers that were found to be of a key: a worker's key never changes, and each report would ask the database.
    pub known: KnownWorkers,
}

/// Workers, with the keys with which they have registered.
#[derive(Debug, Default)]
pub(crate) struct KnownWorkers(Mutex<HashSet<(Tenant, String, String)>>);

impl KnownWorkers {
    /// Most that are remembered: more than a cluster has.
    const MOST: usize = 16_384;

    fn has(&self, worker: &(Tenant, String, String)) -> bool {
        self.lock().contains(worker)
    }

    fn add(&self, worker: (Tenant, String, String)) {
        let mut known = self.lock();
        if known.len() >= Self::MOST {
            known.clear();
        }
        known.insert(worker);
    }

    fn lock(&self) -> MutexGuard<'_, HashSet<(Tenant, String, String)>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl WorkerApi {
    /// Checks that the worker has registered with the caller's key. Where no key is asked for, no worker has one.
    async fn check(&self, caller: &Caller, tenant: &Tenant, id: &str) -> Result<(), RequestError> {
        let Some(key) = caller.key() else {
            return Ok(());
        };
        let worker = (tenant.clone(), id.to_owned(), key.to_owned());
        if !self.known.has(&worker) {
            let store = &self.context.store;
            store.require_worker_of_key(tenant, id, key).await?;
            self.known.add(worker);
        }
        Ok(())
    }

    /// The lease of a claim by the caller's own worker.
    async fn claimed(
        &self,
        caller: &Caller,
        tenant: &Tenant,
        claim: Option<Claim>,
    ) -> Result<LeaseKey, RequestError> {
        let key = lease_key(claim)?;
        self.check(caller, tenant, &key.worker_id).await?;
        Ok(key)
    }
}

fn lease_key(claim: Option<Claim>) -> Result<LeaseKey, RequestError> {
    let claim = claim.ok_or_else(|| RequestError::invalid("claim", "is missing"))?;
    Ok(LeaseKey {
        job_id: fields::id(Collection::Jobs, "claim.job", &claim.job)?,
        worker_id: fields::id(Collection::Workers, "claim.worker", &claim.worker)?,
        token: claim.token,
    })
}

/// The outcome that a worker reports. An error must have a code, so that people can look it up.
fn ending(outcome: Option<Outcome>) -> Result<Ending, RequestError> {
    let coded = |field: &str, error: JobError| {
        if error.code.is_empty() {
            return Err(RequestError::invalid(format!("{field}.code"), "is missing"));
        }
        Ok(worker_text::error(error))
    };
    match outcome {
        Some(Outcome::Succeeded(result)) => Ok(Ending::Succeeded(worker_text::result(result))),
        Some(Outcome::Failed(error)) => Ok(Ending::Failed(coded("failed", error)?)),
        Some(Outcome::Cancelled(_)) => Ok(Ending::Cancelled),
        Some(Outcome::Returned(_)) => Ok(Ending::Returned),
        Some(Outcome::Postponed(error)) => Ok(Ending::Postponed(coded("postponed", error)?)),
        None => Err(RequestError::invalid("outcome", "is missing")),
    }
}

#[tonic::async_trait]
impl WorkerService for WorkerApi {
    async fn register_worker(
        &self,
        request: Request<RegisterWorkerRequest>,
    ) -> Result<Response<RegisterWorkerResponse>, Status> {
        let (caller, tenant) = (Caller::of(&request)?, tenant_of(&request)?);
        let in_process = Client::is_in_process(&request);
        let request = request.into_inner();
        let embedded = match request.embedded && !in_process {
            true => {
                let message = "only a worker in the process of the service is";
                Err(RequestError::invalid("embedded", message))
            }
            false => Ok(request.embedded),
        };
        let kinds = match &request.kinds[..] {
            [] => Err(RequestError::invalid(
                "kinds",
                "a worker needs at least one kind",
            )),
            kinds => fields::job_kinds("kinds", kinds),
        };
        let device = request.device.map(worker_text::device);
        let device = device.ok_or_else(|| RequestError::invalid("device", "is missing"));
        let display_name = fields::display_name(&request.display_name);
        let of_worker = both(display_name, device);
        let ((display_name, device), (kinds, embedded)) = both(of_worker, both(kinds, embedded))?;
        let new = NewWorker {
            display_name,
            device,
            kinds,
            embedded: embedded.then(|| self.context.data_dir.instance.clone()),
            version: worker_text::line(request.version),
            order_level: request.order_level,
            reads_films: request.reads_films,
            key: caller.key().map(str::to_owned),
        };
        let id = lease::register(&self.context, &tenant, new).await?;
        Ok(Response::new(RegisterWorkerResponse {
            worker: Collection::Workers.name(&id),
            lease_seconds: self.context.config.lease_seconds,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            order_level: orders::LEVEL,
        }))
    }

    async fn lease_job(
        &self,
        request: Request<LeaseJobRequest>,
    ) -> Result<Response<LeaseJobResponse>, Status> {
        let (caller, tenant) = (Caller::of(&request)?, tenant_of(&request)?);
        let request = request.get_ref();
        let id = fields::id(Collection::Workers, "worker", &request.worker)?;
        fields::request_id(&request.request_id)?;
        self.check(&caller, &tenant, &id).await?;
        if self.drain.is_cancelled() {
            return Err(RequestError::ShuttingDown.into());
        }
        let lease = lease::lease(
            &self.context,
            &tenant,
            &id,
            &request.request_id,
            request.help,
        )
        .await?;
        Ok(Response::new(LeaseJobResponse { lease }))
    }

    async fn wait_for_job(
        &self,
        request: Request<WaitForJobRequest>,
    ) -> Result<Response<WaitForJobResponse>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.get_ref();
        let kinds = fields::job_kinds("kinds", &request.kinds);
        let time = Duration::try_from_secs_f64(request.seconds);
        let time = time.map_err(|error| RequestError::invalid("seconds", error.to_string()));
        let (kinds, time) = both(kinds, time)?;
        let waiting = &self.context.notifier.hints().waiting;
        let queued = tokio::select! {
            queued = waiting.wait(&tenant, kinds, time.min(LONGEST_WAIT)) => queued,
            () = self.drain.cancelled() => return Err(RequestError::ShuttingDown.into()),
        };
        let queued = queued.map_err(|Busy| RequestError::Busy("workers wait for jobs".into()))?;
        Ok(Response::new(WaitForJobResponse { queued }))
    }

    async fn heartbeat(
        &self,
        request: Request<HeartbeatRequest>,
    ) -> Result<Response<HeartbeatResponse>, Status> {
        let (caller, tenant) = (Caller::of(&request)?, tenant_of(&request)?);
        let request = request.into_inner();
        let key = self.claimed(&caller, &tenant, request.claim).await?;
        let progress = request.progress.map(worker_text::progress);
        let cancel = report::heartbeat(&self.context, &tenant, &key, progress).await?;
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
        let (caller, tenant) = (Caller::of(&request)?, tenant_of(&request)?);
        let request = request.into_inner();
        let key = self.claimed(&caller, &tenant, request.claim).await?;
        let checkpoint = request.checkpoint;
        let checkpoint =
            checkpoint.ok_or_else(|| RequestError::invalid("checkpoint", "is missing"))?;
        let seconds = request.save_seconds;
        report::publish(&self.context, &tenant, &key, checkpoint, seconds).await?;
        Ok(Response::new(PublishCheckpointResponse {}))
    }

    async fn commit_output(
        &self,
        request: Request<CommitOutputRequest>,
    ) -> Result<Response<CommitOutputResponse>, Status> {
        let (caller, tenant) = (Caller::of(&request)?, tenant_of(&request)?);
        let request = request.into_inner();
        let key = self.claimed(&caller, &tenant, request.claim).await?;
        let file = request.file;
        let file = file.ok_or_else(|| RequestError::invalid("file", "is missing"))?;
        report::commit_output(&self.context, &tenant, &key, &file).await?;
        Ok(Response::new(CommitOutputResponse {}))
    }

    async fn take_range(
        &self,
        request: Request<TakeRangeRequest>,
    ) -> Result<Response<TakeRangeResponse>, Status> {
        let (caller, tenant) = (Caller::of(&request)?, tenant_of(&request)?);
        let request = request.into_inner();
        let key = self.claimed(&caller, &tenant, request.claim).await?;
        let (pictures, drawn) = (request.pictures, request.drawn);
        let taken = report::take_range(&self.context, &tenant, &key, pictures, drawn).await?;
        Ok(Response::new(TakeRangeResponse {
            range: taken.range,
            outputs: taken.outputs,
            committed: taken.committed,
            finished: taken.finished,
        }))
    }

    async fn end_job(
        &self,
        request: Request<EndJobRequest>,
    ) -> Result<Response<EndJobResponse>, Status> {
        let (caller, tenant) = (Caller::of(&request)?, tenant_of(&request)?);
        let request = request.into_inner();
        let key = self.claimed(&caller, &tenant, request.claim).await?;
        report::end(&self.context, &tenant, &key, ending(request.outcome)?).await?;
        Ok(Response::new(EndJobResponse {}))
    }
}
