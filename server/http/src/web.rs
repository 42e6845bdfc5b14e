//! Calls of gRPC-Web, as scripts of browsers make them, become calls of gRPC; and which other sites may make calls at all.

use axum::http::header::{
    AUTHORIZATION, CONTENT_RANGE, CONTENT_TYPE, ETAG, HeaderName, RANGE, RETRY_AFTER,
};
use axum::http::{HeaderValue, Method, Request, Response};
use futures::future::BoxFuture;
use std::task::{Context, Poll};
use thiserror::Error;
use tonic::body::Body;
use tonic_web::{GrpcWebLayer, GrpcWebService};
use tower::{Layer, Service, ServiceExt};
use tower_http::cors::{AllowOrigin, CorsLayer};
use url::{Origin, Url};

/// How the content types of gRPC-Web begin.
const KIND: &[u8] = b"application/grpc-web";
/// Headers of calls beside the usual ones.
const ASKED: [&str; 5] = [
    "x-grpc-web",
    "x-user-agent",
    "grpc-timeout",
    "idempotency-key",
    "last-event-id",
];
/// Headers of answers that a script reads.
const TOLD: [&str; 3] = ["grpc-status", "grpc-message", "grpc-status-details-bin"];

/// Turns calls of gRPC-Web into calls of gRPC. All other requests go by: the layer of `tonic-web` refuses those of HTTP/1.
#[derive(Debug, Clone, Copy)]
pub struct WebLayer;

impl<S: Clone> Layer<S> for WebLayer {
    type Service = Web<S>;

    fn layer(&self, inner: S) -> Web<S> {
        Web {
            web: GrpcWebLayer::new().layer(inner.clone()),
            plain: inner,
        }
    }
}

/// Services that are called by gRPC-Web too.
#[derive(Debug, Clone)]
pub struct Web<S> {
    web: GrpcWebService<S>,
    plain: S,
}

impl<S> Service<Request<Body>> for Web<S>
where
    S: Service<Request<Body>, Response = Response<Body>> + Clone + Send + 'static,
    S::Future: Send + 'static,
    S::Error: Send + 'static,
{
    type Response = Response<Body>;
    type Error = S::Error;
    type Future = BoxFuture<'static, Result<Response<Body>, S::Error>>;

    fn poll_ready(&mut self, context: &mut Context<'_>) -> Poll<Result<(), S::Error>> {
        self.plain.poll_ready(context)
    }

    fn call(&mut self, request: Request<Body>) -> Self::Future {
        let kind = request.headers().get(CONTENT_TYPE);
        match kind.is_some_and(|it| it.as_bytes().starts_with(KIND)) {
            true => Box::pin(self.web.clone().oneshot(request)),
            false => Box::pin(self.plain.call(request)),
        }
    }
}

/// A text that is not the origin of a site.
#[derive(Debug, Error)]
#[error("'{0}' is not the origin of a site, such as https://app.example.org")]
pub struct NoOrigin(String);

/// What tells browsers that pages of `origins` may make calls; `None` if there are none. Such calls need a key: without one, only
/// pages of the service itself are admitted.
///
/// # Errors
/// When one is no origin.
pub fn cors(origins: &[String]) -> Result<Option<CorsLayer>, NoOrigin> {
    let origin = |text: &String| {
        let wrong = || NoOrigin(text.clone());
        let url = Url::parse(text).map_err(|_| wrong())?;
        let origin = match url.origin() {
            origin @ Origin::Tuple(..) => origin.ascii_serialization(),
            Origin::Opaque(_) => return Err(wrong()),
        };
        match origin == text.trim_end_matches('/') {
            true => HeaderValue::from_str(&origin).map_err(|_| wrong()),
            false => Err(wrong()),
        }
    };
    let origins: Vec<HeaderValue> = origins.iter().map(origin).collect::<Result<_, _>>()?;
    let named = |names: &'static [&'static str]| names.iter().map(|it| HeaderName::from_static(it));
    let layer = || {
        CorsLayer::new()
            .allow_origin(AllowOrigin::list(origins.clone()))
            .allow_methods([
                Method::GET,
                Method::POST,
                Method::PUT,
                Method::PATCH,
                Method::DELETE,
            ])
            .allow_headers(
                named(&ASKED)
                    .chain([AUTHORIZATION, CONTENT_TYPE, CONTENT_RANGE, RANGE])
                    .collect::<Vec<_>>(),
            )
            .expose_headers(
                named(&TOLD)
                    .chain([CONTENT_RANGE, ETAG, RETRY_AFTER])
                    .collect::<Vec<_>>(),
            )
    };
    Ok((!origins.is_empty()).then(layer))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_origins_are_allowed() {
        let cors = |text: &str| cors(&[text.to_owned()]);
        for good in [
            "https://app.example.org",
            "http://localhost:3000",
            "https://a.org/",
        ] {
            assert!(cors(good).is_ok_and(|it| it.is_some()), "{good}");
        }
        for bad in [
            "*",
            "app.example.org",
            "https://a.org/page",
            "data:x",
            "null",
            "",
        ] {
            let error = cors(bad).expect_err(bad).to_string();
            assert!(error.contains("origin of a site"), "{error}");
        }
        assert!(super::cors(&[]).is_ok_and(|it| it.is_none()));
    }
}
