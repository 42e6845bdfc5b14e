//! Pages over plain HTTP, on the port of gRPC: for balancers, container engines and Prometheus.
//!
//! Each page answers GET and HEAD alone. A page for programs is another file here, another line in [`pages`], and a rule in
//! [`crate::access`], without which it is not answered.

mod backend;
pub mod figures;
mod metrics;
mod probes;
mod shares;

pub use backend::Coordinated;

use crate::context::Context;
use axum::Router;
use axum::routing::get;
use std::sync::Arc;

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
