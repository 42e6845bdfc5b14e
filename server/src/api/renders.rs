//! `yoto.v1.RenderService`.

use super::{fields, public};
use crate::context::Context;
use crate::jobs::queue;
use crate::store::NewJob;
use crate::tenant::Tenant;
use crate::trace_parent::TraceParent;
use std::sync::Arc;
use tonic::{Request, Response, Status};
use yoto_proto::v1::render_service_server::RenderService;
use yoto_proto::v1::{CreateRenderRequest, Job, JobSpec, job_spec};

/// Requests for pictures.
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
        let tenant = Tenant::of(&request)?;
        let trace_parent = TraceParent::of(&request);
        let request = request.into_inner();
        let key = fields::request_key("CreateRender", &request.request_id, &request)?;
        let spec = JobSpec {
            kind: request.spec.map(job_spec::Kind::Render),
        };
        let new = fields::new_job(spec, request.priority, &request.owner)?;
        if request.validate_only {
            let priority = request.priority;
            let job = queue::validate(&self.context, &tenant, new).await?;
            return Ok(Response::new(Job { priority, ..job }));
        }
        let new = NewJob {
            trace_parent,
            ..new
        };
        let job = queue::create(&self.context, &tenant, new, key).await?;
        Ok(Response::new(public::job(job)))
    }
}
