//! The figures of the coordinator, as Prometheus reads them.

use super::figures::exposed;
use crate::context::Context;
use axum::extract::State;
use axum::http::StatusCode;
use axum::http::header::CONTENT_TYPE;
use axum::response::{IntoResponse, Response};
use std::sync::Arc;

/// The text format of OpenMetrics, which Prometheus reads as its own.
const FORMAT: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// All figures. Those of rows are missing while the database can't be read.
pub async fn page(State(context): State<Arc<Context>>) -> Response {
    match exposed(&context).await {
        Ok(text) => ([(CONTENT_TYPE, FORMAT)], text).into_response(),
        Err(error) => {
            tracing::error!(%error, "the figures can't be written");
            StatusCode::INTERNAL_SERVER_ERROR.into_response()
        }
    }
}
