//! `yoto.v1.StatusService`.

use super::{fields, paging};
use crate::context::Context;
use std::sync::Arc;
use tonic::{Request, Response, Status};
use yoto_proto::checks::SPEC_BYTES;
use yoto_proto::checks::scene::MAX_PICTURES;
use yoto_proto::limits::REASON_CHARACTERS;
use yoto_proto::v1::status_service_server::StatusService;
use yoto_proto::v1::{
    CordonWorkerRequest, CordonWorkerResponse, DrainRequest, DrainResponse, EndDrainRequest,
    EndDrainResponse, GetLimitsRequest, GetStatusRequest, ListWorkersRequest, ListWorkersResponse,
    ServiceLimits, ServiceStatus, UncordonWorkerRequest, UncordonWorkerResponse, UploadLimits,
};
use yoto_proto::{limits as contract, orders};
use yoto_request::validation::both;
use yoto_request::{Caller, RequestError, tenant_of};

/// The state of the service as a whole.
pub(crate) struct StatusApi {
    /// The shared parts.
    pub context: Arc<Context>,
}

#[tonic::async_trait]
impl StatusService for StatusApi {
    async fn get_status(
        &self,
        request: Request<GetStatusRequest>,
    ) -> Result<Response<ServiceStatus>, Status> {
        let tenant = tenant_of(&request)?;
        let context = &self.context;
        let lease_seconds = context.config.lease_seconds;
        let workers = context.store.active_workers(&tenant, lease_seconds).await;
        let workers = workers.map_err(RequestError::from)?;
        let state = context.store.service_state(&tenant).await;
        let state = state.map_err(RequestError::from)?;
        let disk = context.storage.place.room();
        Ok(Response::new(ServiceStatus {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            order_level: orders::LEVEL,
            start_time: Some(context.started.into()),
            workers,
            queued: state.queued,
            running: state.running,
            objects: context.storage.url.scheme().to_owned(),
            disk_free: disk.map(|disk| disk.free),
            disk_total: disk.map(|disk| disk.total),
            paused: state.paused,
            draining: state.draining,
            cordons: state.cordons,
        }))
    }

    async fn get_limits(
        &self,
        request: Request<GetLimitsRequest>,
    ) -> Result<Response<ServiceLimits>, Status> {
        let films = self.context.store.reads_films(&tenant_of(&request)?).await;
        let films = films.map_err(RequestError::from)?;
        Ok(Response::new(limits(&self.context, films)))
    }

    async fn drain(
        &self,
        request: Request<DrainRequest>,
    ) -> Result<Response<DrainResponse>, Status> {
        // For the operator: all tenants wait.
        let caller = Caller::of(&request)?;
        let reason = &request.get_ref().reason;
        let reason = fields::line("reason", reason, REASON_CHARACTERS)?;
        let note = fields::note(&reason, &caller);
        let drained = self.context.store.drain(note).await;
        drained.map_err(RequestError::from)?;
        tracing::info!("the service is drained: it takes no new jobs");
        Ok(Response::new(DrainResponse {}))
    }

    async fn end_drain(
        &self,
        _: Request<EndDrainRequest>,
    ) -> Result<Response<EndDrainResponse>, Status> {
        let ended = self.context.store.end_drain().await;
        ended.map_err(RequestError::from)?;
        tracing::info!("the drain has ended: the service takes jobs again");
        Ok(Response::new(EndDrainResponse {}))
    }

    async fn cordon_worker(
        &self,
        request: Request<CordonWorkerRequest>,
    ) -> Result<Response<CordonWorkerResponse>, Status> {
        let caller = Caller::of(&request)?;
        let request = request.get_ref();
        let worker = fields::display_name(&request.display_name);
        let reason = fields::line("reason", &request.reason, REASON_CHARACTERS);
        let (worker, reason) = both(worker, reason)?;
        let note = fields::note(&reason, &caller);
        let store = &self.context.store;
        let cordoned = store.cordon(caller.own_tenant(), &worker, note).await;
        cordoned.map_err(RequestError::from)?;
        tracing::info!(worker, "workers cordoned");
        Ok(Response::new(CordonWorkerResponse {}))
    }

    async fn uncordon_worker(
        &self,
        request: Request<UncordonWorkerRequest>,
    ) -> Result<Response<UncordonWorkerResponse>, Status> {
        let tenant = tenant_of(&request)?;
        let worker = fields::display_name(&request.get_ref().display_name)?;
        let uncordoned = self.context.store.uncordon(&tenant, &worker).await;
        uncordoned.map_err(RequestError::from)?;
        tracing::info!(worker, "workers uncordoned");
        Ok(Response::new(UncordonWorkerResponse {}))
    }

    async fn list_workers(
        &self,
        request: Request<ListWorkersRequest>,
    ) -> Result<Response<ListWorkersResponse>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.get_ref();
        let page = paging::Request::read("workers", request.page_size, &request.page_token, &())?;
        let context = &self.context;
        let workers = context
            .store
            .workers(&tenant, page.page(), context.config.lease_seconds);
        let workers = workers.await.map_err(RequestError::from)?;
        let (workers, next_page_token) = page.cut(workers);
        Ok(Response::new(ListWorkersResponse {
            workers,
            next_page_token,
        }))
    }
}

/// What this service allows: the contract's limits, and those that its operator has set; `films` says whether a worker reads them.
fn limits(context: &Context, films: bool) -> ServiceLimits {
    let (upload, storage) = (&context.config.upload, &context.config.storage);
    let room = context.storage.place.room();
    let room = room.map(|it| it.free.saturating_sub(storage.min_free_bytes));
    ServiceLimits {
        upload: Some(UploadLimits {
            file_bytes: upload.file_bytes,
            capture_bytes: upload.capture_bytes,
            files: upload.files as u64,
            path_bytes: contract::PATH_BYTES as u32,
            expiry_seconds: upload.expiry.as_secs_f64(),
            room_bytes: room,
            films,
        }),
        message_bytes: contract::MESSAGE_BYTES as u64,
        order_bytes: SPEC_BYTES as u64,
        render_pictures: MAX_PICTURES,
        page_entries: contract::LONGEST_PAGE_ENTRIES,
        default_page_entries: contract::PAGE_ENTRIES,
        display_name_bytes: contract::DISPLAY_NAME_BYTES as u32,
        consent_note_bytes: contract::CONSENT_NOTE_BYTES as u32,
        owner_characters: contract::OWNER_CHARACTERS as u32,
        request_id_bytes: contract::REQUEST_ID_BYTES as u32,
    }
}
