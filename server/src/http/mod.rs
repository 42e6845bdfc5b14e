//! Pages over plain HTTP, on the port of gRPC: for balancers, container engines and Prometheus.
//!
//! They are merged into the same router, so connections and calls count towards the same limits. Each page answers GET and
//! HEAD alone. A page for people, or JSON for programs, is another file here and another line in [`pages`].

mod figures;
mod metrics;
mod probes;

use crate::context::Context;
use axum::Router;
use axum::extract::Request;
use axum::http::header::CONTENT_TYPE;
use axum::http::{HeaderMap, Method, StatusCode, Version};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use std::sync::Arc;
use tonic::Status;

/// Whether a request with these headers is a call of gRPC.
pub fn is_grpc(headers: &HeaderMap) -> bool {
    let kind = headers.get(CONTENT_TYPE);
    kind.is_some_and(|it| it.as_bytes().starts_with(b"application/grpc"))
}

/// Whether a browser may have sent the request: those speak HTTP/1.1 where nothing is encrypted, and gRPC needs HTTP/2. Any page
/// of the web can have its visitor's browser post to this machine, so nothing is changed by such a request.
pub fn is_of_a_browser(version: Version, method: &Method) -> bool {
    version < Version::HTTP_2 && !matches!(*method, Method::GET | Method::HEAD)
}

/// The services of gRPC in `router`, and the pages beside them.
pub fn pages(router: Router, context: Arc<Context>) -> Router {
    let pages = Router::new()
        .route("/healthz", get(probes::lives))
        .route("/readyz", get(probes::is_ready))
        .route("/metrics", get(metrics::page))
        .with_state(context);
    router.merge(pages).fallback(unknown)
}

/// The answer to a path of nothing.
async fn unknown(request: Request) -> Response {
    match is_grpc(request.headers()) {
        true => Status::unimplemented("").into_http(),
        false => (StatusCode::NOT_FOUND, "there is no such page\n").into_response(),
    }
}
