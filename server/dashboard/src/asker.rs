//! Who asks for a page, and the calls made for them.

use super::backend::{Backend, Services};
use super::token;
use axum::Router;
use axum::extract::FromRequestParts;
use axum::http::Extensions;
use axum::http::request::Parts;
use axum::response::Response;
use std::convert::Infallible;
use std::sync::Arc;
use tokio_util::sync::CancellationToken;
use tonic::metadata::MetadataMap;
use tonic::{Request, Status};
use tower::ServiceExt;
use uuid::Uuid;
use yoto_proto::v1::{
    GetModelRequest, GetStatusRequest, GetSubjectRequest, Model, ServiceStatus, Subject,
};
use yoto_request::{Caller, tenant_of};
use yoto_store::Tenant;

/// What all pages share.
pub(crate) struct Site {
    /// The services that pages call.
    pub services: Services,
    /// What no call tells.
    pub backend: Arc<dyn Backend>,
    /// Ends the streams of events.
    pub drain: CancellationToken,
    /// The calls over HTTP.
    pub calls: Router,
}

/// Who asks: the services that a page calls, and the extensions of the request, in which the layers have put the tenant.
pub(crate) struct Asker {
    site: Arc<Site>,
    extensions: Extensions,
}

impl FromRequestParts<Arc<Site>> for Asker {
    type Rejection = Infallible;

    async fn from_request_parts(parts: &mut Parts, site: &Arc<Site>) -> Result<Self, Infallible> {
        Ok(Self {
            site: Arc::clone(site),
            extensions: parts.extensions.clone(),
        })
    }
}

impl Asker {
    /// The call that gRPC would make with `message`: the only place in which a page's calls are made.
    pub(crate) fn request<T>(&self, message: T) -> Request<T> {
        Request::from_parts(MetadataMap::new(), self.extensions.clone(), message)
    }

    /// The model with this name.
    pub(crate) async fn model(&self, name: &str) -> Result<Model, Status> {
        let name = name.to_owned();
        let request = self.request(GetModelRequest { name });
        let model = self.services().models.get_model(request).await?;
        Ok(model.into_inner())
    }

    /// The person with this name.
    pub(crate) async fn subject(&self, name: &str) -> Result<Subject, Status> {
        let name = name.to_owned();
        let request = self.request(GetSubjectRequest { name });
        let subject = self.services().subjects.get_subject(request).await?;
        Ok(subject.into_inner())
    }

    /// The state of the service.
    pub(crate) async fn status(&self) -> Result<ServiceStatus, Status> {
        let request = self.request(GetStatusRequest {});
        let status = self.services().status.get_status(request).await?;
        Ok(status.into_inner())
    }

    /// What no call tells.
    pub(crate) fn backend(&self) -> &dyn Backend {
        &*self.site.backend
    }

    /// The asker's tenant, whose rows alone a page reads.
    ///
    /// # Errors
    /// When no layer has told the tenant.
    pub(crate) fn tenant(&self) -> Result<Tenant, Status> {
        Ok(tenant_of(&self.request(()))?)
    }

    /// The id of the asker's key; none if no key is asked for.
    pub(crate) fn key(&self) -> Option<String> {
        let caller = Caller::of(&self.request(())).ok()?;
        caller.key().map(str::to_owned)
    }

    /// The service's time, seconds since 1970.
    pub(crate) fn now(&self) -> f64 {
        self.site.backend.now()
    }

    /// Ends the streams of events.
    pub(crate) fn drain(&self) -> &CancellationToken {
        &self.site.drain
    }

    /// Makes a call over HTTP as the asker: `request` has the asker's extensions.
    pub(crate) async fn call(&self, request: axum::extract::Request) -> Response {
        match self.site.calls.clone().oneshot(request).await {
            Ok(answer) => answer,
            Err(never) => match never {},
        }
    }

    /// The token of the asker's forms.
    ///
    /// # Errors
    /// When no layer has told the tenant.
    pub(crate) fn token(&self) -> Result<String, Status> {
        let tenant = self.tenant()?;
        Ok(token::of(self.site.backend.store_id(), &tenant))
    }

    /// The id of a request that a form makes: a form that is sent twice asks once.
    pub(crate) fn request_id() -> String {
        Uuid::new_v4().to_string()
    }

    /// The services of the contract.
    pub(crate) fn services(&self) -> &Services {
        &self.site.services
    }
}
