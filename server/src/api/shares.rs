//! `yoto.v1.ShareService`.

use super::{fields, paging};
use crate::access;
use crate::context::Context;
use std::sync::Arc;
use tonic::{Request, Response, Status};
use yoto_http::file_kind::page_of_export;
use yoto_proto::limits::OWNER_CHARACTERS;
use yoto_proto::names::Collection;
use yoto_proto::sha256_hex;
use yoto_proto::v1::share_service_server::ShareService;
use yoto_proto::v1::{
    CreateShareRequest, CreateShareResponse, ErrorReason, Job, ListSharesRequest,
    ListSharesResponse, RevokeShareRequest, Share, job, job_spec,
};
use yoto_request::validation::both;
use yoto_request::{RequestError, tenant_of};
use yoto_store::{NewShare, ShareFilter};

/// Links to pages of exports.
pub(crate) struct ShareApi {
    /// The shared parts.
    pub context: Arc<Context>,
}

#[tonic::async_trait]
impl ShareService for ShareApi {
    async fn create_share(
        &self,
        request: Request<CreateShareRequest>,
    ) -> Result<Response<CreateShareResponse>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.into_inner();
        let id = fields::id(Collection::Jobs, "job", &request.job);
        let note = fields::line("note", &request.note, OWNER_CHARACTERS);
        let now = self.context.config.clock.now();
        let end = fields::end("expire_time", request.expire_time.as_ref(), Some(now));
        let ((job_id, note), expire_time) = both(both(id, note), end)?;
        let job = self.context.store.job(&tenant, &job_id).await;
        let job = job.map_err(RequestError::from)?;
        let subject_id = subject_of_page(&job)?;
        let secret = access::keys::random();
        let new = NewShare {
            job_id,
            subject_id,
            sha256: sha256_hex(secret.as_bytes()),
            note,
            embed: request.embed,
            expire_time,
        };
        let share = self.context.store.create_share(&tenant, &new).await;
        let share = share.map_err(RequestError::from)?;
        tracing::info!(share = share.name, job = share.job, "a link was made");
        Ok(Response::new(CreateShareResponse {
            share: Some(share),
            path: format!("/share/{secret}"),
        }))
    }

    async fn list_shares(
        &self,
        request: Request<ListSharesRequest>,
    ) -> Result<Response<ListSharesResponse>, Status> {
        let tenant = tenant_of(&request)?;
        let request = request.into_inner();
        let (size, token) = (request.page_size, request.page_token.clone());
        let of = |collection, field, name: &str| match name {
            "" => Ok(None),
            name => fields::id(collection, field, name).map(Some),
        };
        let job = of(Collection::Jobs, "job", &request.job);
        let subject = of(Collection::Subjects, "subject", &request.subject);
        let filter = ListSharesRequest {
            page_size: 0,
            page_token: String::new(),
            ..request
        };
        let page = paging::Request::read("shares", size, &token, &filter);
        let (page, (job_id, subject_id)) = both(page, both(job, subject))?;
        let filter = ShareFilter { job_id, subject_id };
        let found = self.context.store.shares(&tenant, &filter, page.page());
        let (shares, next_page_token) = page.cut(found.await.map_err(RequestError::from)?);
        Ok(Response::new(ListSharesResponse {
            shares,
            next_page_token,
        }))
    }

    async fn revoke_share(
        &self,
        request: Request<RevokeShareRequest>,
    ) -> Result<Response<Share>, Status> {
        let tenant = tenant_of(&request)?;
        let id = fields::id(Collection::Shares, "name", &request.get_ref().name)?;
        let share = self.context.store.revoke_share(&tenant, &id).await;
        let share = share.map_err(RequestError::from)?;
        tracing::info!(share = share.name, "a link was revoked");
        Ok(Response::new(share))
    }
}

/// The id of the person whose page the job has made.
fn subject_of_page(job: &Job) -> Result<String, RequestError> {
    let spec = job.spec.as_ref().and_then(|it| it.kind.as_ref());
    let (Some(job_spec::Kind::Export(spec)), Some(_)) = (spec, page_of_export(job)) else {
        let message = match job.state() {
            job::State::Succeeded => format!(
                "{} has made no page: a link needs an export with the form EXPORT_FORM_PAGE",
                job.name
            ),
            state => format!(
                "{} is {}: a link needs an export that has succeeded",
                job.name,
                state.as_str_name()
            ),
        };
        return Err(RequestError::precondition(
            ErrorReason::NotSucceeded,
            message,
        ));
    };
    fields::id(Collection::Subjects, "job", &spec.subject)
}
