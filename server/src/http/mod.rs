//! Pages over plain HTTP, on the port of gRPC: for balancers, container engines and Prometheus.
//!
//! They are merged into the same router, so connections and calls count towards the same limits. Each page answers GET and
//! HEAD alone. A page for programs is another file here, another line in [`pages`], and a rule in `crate::access`, without
//! which it is not answered. The calls of the contract over HTTP are in [`transcoding`].

pub mod figures;
mod metrics;
mod probes;
mod shares;
pub mod transcoding;
mod web;

pub use web::{WebLayer, cors};

use crate::context::Context;
use axum::Router;
use axum::http::header::{CONTENT_TYPE, WWW_AUTHENTICATE};
use axum::http::{HeaderMap, HeaderValue, Response, StatusCode};
use axum::routing::get;
use bytes::Bytes;
use http_body_util::{BodyExt, Full};
use std::sync::Arc;
use tonic::body::Body;
use tonic::{Code, Status};

/// Whether a request with these headers is a call of gRPC.
pub fn is_grpc(headers: &HeaderMap) -> bool {
    let kind = headers.get(CONTENT_TYPE);
    kind.is_some_and(|it| it.as_bytes().starts_with(b"application/grpc"))
}

/// The pages beside `router`.
pub fn pages(router: Router, context: Arc<Context>) -> Router {
    let pages = Router::new()
        .route("/healthz", get(probes::lives))
        .route("/readyz", get(probes::is_ready))
        .route("/metrics", get(metrics::page))
        .route("/share/{secret}", get(shares::page))
        .with_state(context);
    router.merge(pages)
}

/// The answer to an unknown path.
pub fn unknown(grpc: bool) -> Response<Body> {
    match grpc {
        true => Status::unimplemented("").into_http(),
        false => text(StatusCode::NOT_FOUND, "there is no such page"),
    }
}

/// The answer to a caller who may not call.
pub fn refusal(status: &Status, grpc: bool) -> Response<Body> {
    match grpc {
        true => status.clone().into_http(),
        false => refused(status),
    }
}

/// A refusal in one line.
fn refused(status: &Status) -> Response<Body> {
    let code = match status.code() {
        Code::Unauthenticated => StatusCode::UNAUTHORIZED,
        Code::PermissionDenied => StatusCode::FORBIDDEN,
        _ => StatusCode::SERVICE_UNAVAILABLE,
    };
    let mut refused = text(code, status.message());
    if code == StatusCode::UNAUTHORIZED {
        let scheme = HeaderValue::from_static("Bearer");
        refused.headers_mut().insert(WWW_AUTHENTICATE, scheme);
    }
    refused
}

/// A page with one line.
pub fn text(code: StatusCode, line: &str) -> Response<Body> {
    let body = Full::new(Bytes::from(format!("{line}\n"))).map_err(|never| match never {});
    let mut page = Response::new(Body::new(body));
    *page.status_mut() = code;
    page
}
