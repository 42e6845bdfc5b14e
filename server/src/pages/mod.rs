//! Pages over plain HTTP, on the port of gRPC: for balancers, container engines and Prometheus.
//!
//! Each page answers GET and HEAD alone. A page for programs is another file here, another line in [`pages`], and a rule in
//! [`crate::access`], without which it is not answered.

mod backend;
pub(crate) mod figures;
mod metrics;
mod probes;
mod reads;
mod shares;

pub(crate) use backend::Coordinated;

use crate::context::Context;
use axum::Router;
use axum::routing::get;
use std::sync::Arc;

/// What the page of metrics needs.
#[derive(Clone)]
struct Pages {
    context: Arc<Context>,
    last: Arc<figures::LastText>,
}

/// The pages beside `router`.
pub(crate) fn pages(router: Router, context: Arc<Context>) -> Router {
    let pages = Router::new()
        .route("/healthz", get(probes::lives))
        .route("/readyz", get(probes::is_ready))
        .route("/share/{secret}", get(shares::page))
        .with_state(Arc::clone(&context));
    let last = Arc::default();
    let metrics = Router::new()
        .route("/metrics", get(metrics::page))
        .with_state(Pages { context, last });
    router.merge(pages).merge(metrics)
}
