//! Who asks for a page, and the calls made for them.

use super::token;
use crate::access::Caller;
use crate::api::{JobApi, ModelApi, ObjectApi, ShareApi, StatusApi, SubjectApi, TenantApi};
use crate::context::Context;
use crate::tenant::Tenant;
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

/// What all pages share.
pub struct Site {
    context: Arc<Context>,
    drain: CancellationToken,
    subjects: SubjectApi,
    models: ModelApi,
    jobs: JobApi,
    objects: ObjectApi,
    status: StatusApi,
    tenants: TenantApi,
    shares: ShareApi,
    calls: Router,
}

impl Site {
    /// The services that pages call, over the shared parts, and the same `calls` over HTTP. `drain` ends the streams of events.
    pub fn new(context: Arc<Context>, drain: CancellationToken, calls: Router) -> Self {
        let shared = || Arc::clone(&context);
        Self {
            subjects: SubjectApi { context: shared() },
            models: ModelApi { context: shared() },
            jobs: JobApi {
                context: shared(),
                drain: drain.clone(),
            },
            objects: ObjectApi { context: shared() },
            status: StatusApi { context: shared() },
            tenants: TenantApi { context: shared() },
            shares: ShareApi { context: shared() },
            context,
            drain,
            calls,
        }
    }
}

/// Who asks: the services that a page calls, and the extensions of the request, in which the layers have put the tenant.
pub struct Asker {
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
    pub fn request<T>(&self, message: T) -> Request<T> {
        Request::from_parts(MetadataMap::new(), self.extensions.clone(), message)
    }

    /// The shared parts, for what is told to everybody: the health and the last collection.
    pub fn context(&self) -> &Arc<Context> {
        &self.site.context
    }

    /// The id of the asker's key; none if no key is asked for.
    pub fn key(&self) -> Option<String> {
        let caller = Caller::of(&self.request(())).ok()?;
        caller.key().map(str::to_owned)
    }

    /// The service's time, seconds since 1970.
    pub fn now(&self) -> f64 {
        self.site.context.config.clock.now()
    }

    /// Ends the streams of events.
    pub fn drain(&self) -> &CancellationToken {
        &self.site.drain
    }

    /// Makes a call over HTTP as the asker: `request` has the asker's extensions.
    pub async fn call(&self, request: axum::extract::Request) -> Response {
        match self.site.calls.clone().oneshot(request).await {
            Ok(answer) => answer,
            Err(never) => match never {},
        }
    }

    /// The token of the asker's forms.
    ///
    /// # Errors
    /// When no layer has told the tenant.
    pub fn token(&self) -> Result<String, Status> {
        let tenant = Tenant::of(&self.request(()))?;
        Ok(token::of(&self.site.context.store_id, &tenant))
    }

    /// The id of a request that a form makes: a form that is sent twice asks once.
    pub fn request_id() -> String {
        Uuid::new_v4().to_string()
    }

    /// People and captures.
    pub fn subjects(&self) -> &SubjectApi {
        &self.site.subjects
    }

    /// Models and checkpoints.
    pub fn models(&self) -> &ModelApi {
        &self.site.models
    }

    /// Jobs.
    pub fn jobs(&self) -> &JobApi {
        &self.site.jobs
    }

    /// Files.
    pub fn objects(&self) -> &ObjectApi {
        &self.site.objects
    }

    /// Links to pages.
    pub fn shares(&self) -> &ShareApi {
        &self.site.shares
    }

    /// Usage of tenants.
    pub fn tenants(&self) -> &TenantApi {
        &self.site.tenants
    }

    /// The service and its workers.
    pub fn status(&self) -> &StatusApi {
        &self.site.status
    }
}
