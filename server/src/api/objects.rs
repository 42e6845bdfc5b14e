//! `yoto.v1.ObjectService`.

use super::{fields, paging};
use crate::context::Context;
use crate::objects::manifest;
use futures::stream::BoxStream;
use futures::{StreamExt, TryStreamExt};
use std::sync::Arc;
use tonic::{Request, Response, Status};
use yoto_http::job_files::{TRADEOFF, files_of_result};
use yoto_http::transcoding::NamedObjects;
use yoto_proto::manifest::files;
use yoto_proto::names::{self, Collection};
use yoto_proto::v1::object_service_server::ObjectService;
use yoto_proto::v1::{
    DownloadObjectRequest, DownloadObjectResponse, ErrorReason, Job, JobKind, ListObjectsRequest,
    ListObjectsResponse, NamedObject, ObjectRef, SignDownloadRequest, SignDownloadResponse,
    Unsigned, job,
};
use yoto_request::{RequestError, tenant_of};
use yoto_store::Tenant;

/// Files per page if the request does not say.
const MAX_PAGE: i32 = 1000;

/// Files that jobs have written.
pub(crate) struct ObjectApi {
    /// The shared parts.
    pub context: Arc<Context>,
}

#[tonic::async_trait]
impl ObjectService for ObjectApi {
    async fn list_objects(
        &self,
        request: Request<ListObjectsRequest>,
    ) -> Result<Response<ListObjectsResponse>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.get_ref();
        let parent = &request.parent;
        let size = match request.page_size {
            0 => MAX_PAGE,
            size => size,
        };
        let page = paging::Request::read("objects", size, &request.page_token, parent)?;
        let found = self.objects(&tenant, "parent", parent).await?;
        let objects = found.into_iter().map(|(file, object)| NamedObject {
            name: names::object(parent, &file),
            file,
            bytes: object.bytes,
            sha256: object.sha256,
        });
        let (objects, next_page_token) = page.cut(page.of_all(objects.collect()));
        Ok(Response::new(ListObjectsResponse {
            objects,
            next_page_token,
        }))
    }

    type DownloadObjectStream = BoxStream<'static, Result<DownloadObjectResponse, Status>>;

    async fn download_object(
        &self,
        request: Request<DownloadObjectRequest>,
    ) -> Result<Response<Self::DownloadObjectStream>, Status> {
        let tenant = tenant_of(&request)?;
        let DownloadObjectRequest {
            name,
            offset,
            length,
        } = request.get_ref();
        let object = self.named(&tenant, name).await?;
        if *offset > object.bytes {
            let message = format!("{offset} is beyond the file's {} bytes", object.bytes);
            return Err(RequestError::invalid("offset", message).into());
        }
        let end = match *length {
            0 => object.bytes,
            length => offset.saturating_add(length).min(object.bytes),
        };
        if *offset == end {
            return Ok(Response::new(futures::stream::empty().boxed()));
        }
        let bytes = (self.context.objects)
            .stream(&object, Some(*offset..end))
            .await
            .map_err(RequestError::from)?;
        let answers = bytes.map_ok(|chunk| DownloadObjectResponse {
            chunk: chunk.to_vec(),
        });
        Ok(Response::new(
            answers
                .map_err(|error| RequestError::from(error).into())
                .boxed(),
        ))
    }

    async fn sign_download(
        &self,
        request: Request<SignDownloadRequest>,
    ) -> Result<Response<SignDownloadResponse>, Status> {
        let tenant = tenant_of(&request)?;
        let object = self.named(&tenant, &request.get_ref().name).await?;
        let without = |reason: Unsigned| {
            Ok(Response::new(SignDownloadResponse {
                unsigned: reason.into(),
                ..SignDownloadResponse::default()
            }))
        };
        let Some(life) = self.context.config.signed_urls else {
            return without(Unsigned::TurnedOff);
        };
        let end = self.context.config.clock.time() + life;
        let signed = self.context.objects.url_to_read(&object.key, life).await;
        let Some(url) = signed.map_err(RequestError::from)? else {
            return without(Unsigned::NotSupported);
        };
        Ok(Response::new(SignDownloadResponse {
            url: url.into(),
            expire_time: Some(end.into()),
            ..SignDownloadResponse::default()
        }))
    }
}

#[tonic::async_trait]
impl NamedObjects for ObjectApi {
    async fn named(&self, tenant: &Tenant, name: &str) -> Result<ObjectRef, RequestError> {
        let (parent, file) = names::parse_object(name)
            .map_err(|error| RequestError::invalid("name", error.to_string()))?;
        let objects = self.objects(tenant, "name", parent).await?;
        let object = objects.into_iter().find(|(known, _)| known == file);
        let (_, object) = object.ok_or_else(|| RequestError::NotFound {
            name: name.chars().take(200).collect(),
        })?;
        Ok(object)
    }
}

impl ObjectApi {
    /// The files of `parent`; `field` is the path of its name in the request.
    async fn objects(
        &self,
        tenant: &Tenant,
        field: &str,
        parent: &str,
    ) -> Result<Vec<(String, ObjectRef)>, RequestError> {
        if let Ok((model, _)) = names::parse_checkpoint(parent) {
            return self.of_checkpoint(tenant, model, parent).await;
        }
        if let Ok(id) = Collection::Captures.parse(parent) {
            let files = self
                .context
                .store
                .capture_objects(tenant, id)
                .await?
                .into_iter();
            let files = files.filter_map(|it| Some((it.file, it.object?)));
            return Ok(files.collect());
        }
        let Ok(id) = fields::id(Collection::Jobs, field, parent) else {
            let shown: String = parent.chars().take(200).collect();
            let message = format!("'{shown}' is neither a job nor a checkpoint nor a capture");
            return Err(RequestError::invalid(field, message));
        };
        let job = self.context.store.job_state(tenant, &id).await?;
        let commits = matches!(job.kind(), JobKind::Render | JobKind::Export);
        if commits && job.state() != job::State::Succeeded {
            let committed = self.context.store.outputs(tenant, &id).await?.into_iter();
            let committed = committed.filter_map(|it| Some((it.file, it.object?)));
            return Ok(committed.collect());
        }
        of_job(&job)
    }

    async fn of_checkpoint(
        &self,
        tenant: &Tenant,
        model: &str,
        name: &str,
    ) -> Result<Vec<(String, ObjectRef)>, RequestError> {
        let checkpoints = self
            .context
            .store
            .checkpoints(tenant, model, u32::MAX)
            .await?;
        let checkpoint = checkpoints.into_iter().find(|it| it.name == name);
        let checkpoint = checkpoint.ok_or_else(|| RequestError::NotFound { name: name.into() })?;
        let torn =
            |message: String| RequestError::precondition(ErrorReason::CheckpointTorn, message);
        let object = checkpoint
            .manifest
            .ok_or_else(|| torn(format!("{name} has no manifest")))?;
        let manifest = manifest::read(&self.context, &object).await?;
        let data = manifest.objects.into_iter().map(|it| {
            let object = ObjectRef {
                key: it.key,
                bytes: it.bytes,
                sha256: it.sha256,
            };
            (it.file, object)
        });
        let tradeoff = checkpoint.tradeoff.map(|it| (TRADEOFF.to_owned(), it));
        let manifest = Some((files::MANIFEST.to_owned(), object));
        Ok(data.chain(manifest).chain(tradeoff).collect())
    }
}

/// The files of a job that has succeeded.
fn of_job(job: &Job) -> Result<Vec<(String, ObjectRef)>, RequestError> {
    if job.state() != job::State::Succeeded {
        let message = format!("{} is {}", job.name, job.state().as_str_name());
        return Err(RequestError::precondition(
            ErrorReason::NotSucceeded,
            message,
        ));
    }
    Ok(files_of_result(job))
}
