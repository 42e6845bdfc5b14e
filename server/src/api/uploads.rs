//! `yoto.v1.UploadService`.

use super::fields;
use crate::context::Context;
use crate::uploads::{self, describe};
use futures::TryStreamExt;
use std::sync::Arc;
use tonic::{Request, Response, Status, Streaming};
use yoto_process::metrics::METRICS;
use yoto_proto::names::Collection;
use yoto_proto::v1::upload_service_server::UploadService;
use yoto_proto::v1::{
    Capture, CommitPartRequest, CommitPartResponse, CreateUploadRequest, FinishUploadRequest,
    GetUploadRequest, SignPartsRequest, SignPartsResponse, Upload, WriteUploadRequest,
    WriteUploadResponse,
};
use yoto_request::tenant_of;

/// Captures on their way into the service.
pub(crate) struct UploadApi {
    /// The shared parts.
    pub context: Arc<Context>,
}

#[tonic::async_trait]
impl UploadService for UploadApi {
    async fn create_upload(
        &self,
        request: Request<CreateUploadRequest>,
    ) -> Result<Response<Upload>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.into_inner();
        let key = fields::request_key("CreateUpload", &request.request_id, &request)?;
        let subject = fields::id(Collection::Subjects, "subject", &request.subject)?;
        let limits = &self.context.config.upload;
        if request.validate_only {
            let files = request.files;
            let upload = uploads::validate(&self.context, &tenant, subject, files).await?;
            return Ok(Response::new(upload));
        }
        let upload = uploads::create(&self.context, &tenant, subject, request.files, key).await?;
        Ok(Response::new(describe(limits, &upload)))
    }

    async fn write_upload(
        &self,
        request: Request<Streaming<WriteUploadRequest>>,
    ) -> Result<Response<WriteUploadResponse>, Status> {
        let tenant = tenant_of(&request)?;
        // A separate task: when the caller disconnects, this future is dropped, but what has come is
        // committed nevertheless.
        let chunks = request
            .into_inner()
            .inspect_ok(|it| METRICS.uploaded(it.chunk.len()));
        let receiving = uploads::receive(Arc::clone(&self.context), tenant, chunks);
        let written = tokio::spawn(receiving).await.map_err(|error| {
            tracing::error!(%error, "a write of an upload ended early");
            Status::internal("the write ended early")
        })??;
        Ok(Response::new(written))
    }

    async fn sign_parts(
        &self,
        request: Request<SignPartsRequest>,
    ) -> Result<Response<SignPartsResponse>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.into_inner();
        let id = fields::id(Collection::Uploads, "upload", &request.upload)?;
        let (writer, parts) = (request.writer, &request.parts);
        let signed = uploads::sign_parts(&self.context, &tenant, &id, writer, parts).await?;
        Ok(Response::new(signed))
    }

    async fn commit_part(
        &self,
        request: Request<CommitPartRequest>,
    ) -> Result<Response<CommitPartResponse>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.into_inner();
        let id = fields::id(Collection::Uploads, "upload", &request.upload)?;
        uploads::commit_part(&self.context, &tenant, &id, request).await?;
        Ok(Response::new(CommitPartResponse {}))
    }

    async fn get_upload(
        &self,
        request: Request<GetUploadRequest>,
    ) -> Result<Response<Upload>, Status> {
        let tenant = tenant_of(&request)?;
        let GetUploadRequest { name, stop_writer } = request.get_ref();
        let id = fields::id(Collection::Uploads, "name", name)?;
        let upload = uploads::get(&self.context, &tenant, &id, *stop_writer).await?;
        let limits = &self.context.config.upload;
        Ok(Response::new(describe(limits, &upload)))
    }

    async fn finish_upload(
        &self,
        request: Request<FinishUploadRequest>,
    ) -> Result<Response<Capture>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.into_inner();
        let key = fields::request_key("FinishUpload", &request.request_id, &request)?;
        let id = fields::id(Collection::Uploads, "name", &request.name)?;
        let capture = uploads::finish(&self.context, &tenant, &id, key).await?;
        Ok(Response::new(capture))
    }
}
