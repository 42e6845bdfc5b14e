//! `yoto.v1.RenderService`.

use super::fields;
use super::orders::{Order, order_job};
use crate::context::Context;
use std::sync::Arc;
use tonic::{Request, Response, Status};
use yoto_proto::v1::render_service_server::RenderService;
use yoto_proto::v1::{CreateRenderRequest, Job, JobSpec, job_spec};
use yoto_request::{tenant_of, trace_parent_of};

/// Requests for pictures.
pub(crate) struct RenderApi {
    /// The shared parts.
    pub context: Arc<Context>,
}

#[tonic::async_trait]
impl RenderService for RenderApi {
    async fn create_render(
        &self,
        request: Request<CreateRenderRequest>,
    ) -> Result<Response<Job>, Status> {
        let tenant = tenant_of(&request)?;
        let trace_parent = trace_parent_of(&request);
        let request = request.into_inner();
        let order = Order {
            key: fields::request_key("CreateRender", &request.request_id, &request),
            spec: JobSpec {
                kind: request.spec.map(job_spec::Kind::Render),
            },
            priority: request.priority,
            owner: request.owner,
            validate_only: request.validate_only,
            trace_parent,
        };
        let job = order_job(&self.context, &tenant, order).await?;
        Ok(Response::new(job))
    }
}
