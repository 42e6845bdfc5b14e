//! `yoto.v1.StatusService`.

use super::paging;
use crate::context::Context;
use crate::error::RequestError;
use crate::tenant::Tenant;
use std::sync::Arc;
use tonic::{Request, Response, Status};
use yoto_proto::checks::SPEC_BYTES;
use yoto_proto::checks::scene::MAX_PICTURES;
use yoto_proto::limits as contract;
use yoto_proto::orders;
use yoto_proto::v1::status_service_server::StatusService;
use yoto_proto::v1::{
    GetLimitsRequest, GetStatusRequest, ListWorkersRequest, ListWorkersResponse, ServiceLimits,
    ServiceStatus, UploadLimits,
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
        let lease_seconds = context.config.lease_seconds;
        let workers = context.store.active_workers(&tenant, lease_seconds).await;
        let workers = workers.map_err(RequestError::from)?;
        let counts = context.store.open_jobs(&tenant).await;
        let (queued, running) = counts.map_err(RequestError::from)?;
        let paused = context.store.paused_kinds(&tenant).await;
        let disk = context.place.room();
        Ok(Response::new(ServiceStatus {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            order_level: orders::LEVEL,
            start_time: Some(context.started.into()),
            workers,
            queued,
            running,
            objects: context.objects_url.scheme().to_owned(),
            disk_free: disk.map(|disk| disk.free),
            disk_total: disk.map(|disk| disk.total),
            paused: paused.map_err(RequestError::from)?,
        }))
    }

    async fn get_limits(
        &self,
        _: Request<GetLimitsRequest>,
    ) -> Result<Response<ServiceLimits>, Status> {
        Ok(Response::new(limits(&self.context)))
    }

    async fn list_workers(
        &self,
        request: Request<ListWorkersRequest>,
    ) -> Result<Response<ListWorkersResponse>, Status> {
        let tenant = Tenant::of(&request)?;
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

/// What this service allows: the contract's limits, and those that its operator has set.
fn limits(context: &Context) -> ServiceLimits {
    let (upload, storage) = (&context.config.upload, &context.config.storage);
    let room = context.place.room();
    let room = room.map(|it| it.free.saturating_sub(storage.min_free_bytes));
    ServiceLimits {
        upload: Some(UploadLimits {
            file_bytes: upload.file_bytes,
            capture_bytes: upload.capture_bytes,
            files: upload.files as u64,
            path_bytes: contract::PATH_BYTES as u32,
            expiry_seconds: upload.expiry.as_secs_f64(),
            room_bytes: room,
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
