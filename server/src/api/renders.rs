//! `yoto.v1.RenderService`.

use super::fields;
use crate::{context::Context, error::RequestError, jobs::queue};
use futures::{StreamExt, TryStreamExt, stream::BoxStream};
use std::sync::Arc;
use tonic::{Request, Response, Status};
use yoto_proto::{
    names::Collection,
    v1::{
        CreateRenderRequest, DownloadRenderRequest, DownloadRenderResponse, Job, JobSpec,
        ObjectRef, job, job_result, job_spec, render_service_server::RenderService,
    },
};

/// Requests for pictures, and downloads of them.
pub struct RenderApi {
    /// The shared parts.
    pub context: Arc<Context>,
}

#[tonic::async_trait]
impl RenderService for RenderApi {
    async fn create_render(
        &self,
        request: Request<CreateRenderRequest>,
    ) -> Result<Response<Job>, Status> {
        let request = request.into_inner();
        let key = fields::request_key("CreateRender", &request.request_id, &request)?;
        let spec = JobSpec {
            kind: request.spec.map(job_spec::Kind::Render),
        };
        Ok(Response::new(
            queue::create(&self.context, spec, key).await?,
        ))
    }

    type DownloadRenderStream = BoxStream<'static, Result<DownloadRenderResponse, Status>>;

    async fn download_render(
        &self,
        request: Request<DownloadRenderRequest>,
    ) -> Result<Response<Self::DownloadRenderStream>, Status> {
        let request = request.get_ref();
        let id = fields::id(Collection::Jobs, "job", &request.job)?;
        let job = self
            .context
            .store
            .job(&id)
            .await
            .map_err(RequestError::from)?;
        let object = rendered(&job, &request.file)?;
        let bytes = self
            .context
            .objects
            .get(&object)
            .await
            .map_err(RequestError::from)?;
        let answers = bytes.map_ok(|chunk| DownloadRenderResponse {
            chunk: chunk.to_vec(),
        });
        Ok(Response::new(
            answers
                .map_err(|error| RequestError::from(error).into())
                .boxed(),
        ))
    }
}

/// The object behind `file` of a render job that has SUCCEEDED.
fn rendered(job: &Job, file: &str) -> Result<ObjectRef, RequestError> {
    let kind = job.spec.as_ref().and_then(|spec| spec.kind.as_ref());
    if !matches!(kind, Some(job_spec::Kind::Render(_))) {
        return Err(RequestError::invalid(
            "job",
            format!("{} is not a render job", job.name),
        ));
    }
    if job.state() != job::State::Succeeded {
        let message = format!("{} is {}", job.name, job.state().as_str_name());
        return Err(RequestError::precondition("NOT_SUCCEEDED", message));
    }
    let result = job.result.as_ref().and_then(|result| result.kind.as_ref());
    let files = match result {
        Some(job_result::Kind::Render(render)) => render.files.as_slice(),
        _ => &[],
    };
    let found = files.iter().find(|rendered| rendered.file == file);
    found
        .and_then(|rendered| rendered.object.clone())
        .ok_or_else(|| {
            let shown: String = file.chars().take(80).collect();
            RequestError::NotFound {
                name: format!("file '{shown}' of {}", job.name),
            }
        })
}
