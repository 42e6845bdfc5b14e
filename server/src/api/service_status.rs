//! `yoto.v1.StatusService`.

use super::paging;
use crate::context::Context;
use crate::error::RequestError;
use crate::tenant::Tenant;
use std::collections::HashMap;
use std::sync::Arc;
use std::time::SystemTime;
use tonic::{Request, Response, Status};
use yoto_proto::names::Collection;
use yoto_proto::v1::status_service_server::StatusService;
use yoto_proto::v1::{
    GetStatusRequest, ListWorkersRequest, ListWorkersResponse, ServiceStatus, WorkerStatus,
};

/// The state of the service as a whole.
pub struct StatusApi {
    /// The shared parts.
    pub context: Arc<Context>,
}

#[tonic::async_trait]
impl StatusService for StatusApi {
    async fn get_status(
        &self,
        request: Request<GetStatusRequest>,
    ) -> Result<Response<ServiceStatus>, Status> {
        let tenant = Tenant::of(&request)?;
        let context = &self.context;
        let lately = context.roster.lately(context.config.clock.time());
        let ids: Vec<&str> = lately.keys().map(String::as_str).collect();
        let lease_seconds = context.config.lease_seconds;
        let workers = context
            .store
            .active_workers(&tenant, &ids, lease_seconds)
            .await;
        let mut workers = workers.map_err(RequestError::from)?;
        for worker in &mut workers {
            add_request(worker, &lately);
        }
        let counts = context.store.open_jobs(&tenant).await;
        let (queued, running) = counts.map_err(RequestError::from)?;
        let paused = context.store.paused_kinds(&tenant).await;
        let disk = context.disk.room();
        Ok(Response::new(ServiceStatus {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            start_time: Some(context.started.into()),
            workers,
            queued,
            running,
            objects: context.objects_url.to_string(),
            disk_free: disk.map(|disk| disk.free),
            disk_total: disk.map(|disk| disk.total),
            paused: paused.map_err(RequestError::from)?,
        }))
    }

    async fn list_workers(
        &self,
        request: Request<ListWorkersRequest>,
    ) -> Result<Response<ListWorkersResponse>, Status> {
        let tenant = Tenant::of(&request)?;
        let request = request.get_ref();
        let page = paging::Request::read("workers", request.page_size, &request.page_token)?;
        let context = &self.context;
        let workers = context
            .store
            .workers(&tenant, page.page(), context.config.lease_seconds);
        let mut workers = workers.await.map_err(RequestError::from)?;
        let lately = context.roster.lately(context.config.clock.time());
        for entry in &mut workers {
            add_request(&mut entry.item, &lately);
        }
        let (workers, next_page_token) = page.cut(workers);
        Ok(Response::new(ListWorkersResponse {
            workers,
            next_page_token,
        }))
    }
}

/// A worker is seen whenever it asks for a job, and whenever it reports on one.
fn add_request(worker: &mut WorkerStatus, lately: &HashMap<String, SystemTime>) {
    let id = Collection::Workers.parse(&worker.name).unwrap_or_default();
    let Some(asked) = lately.get(id) else { return };
    let asked = prost_types::Timestamp::from(*asked);
    let key = |at: &prost_types::Timestamp| (at.seconds, at.nanos);
    if worker
        .last_seen
        .as_ref()
        .is_none_or(|seen| key(seen) < key(&asked))
    {
        worker.last_seen = Some(asked);
    }
}
