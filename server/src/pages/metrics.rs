//! The figures of the coordinator, as Prometheus reads them.

use super::Pages;
use super::figures::exposed;
use axum::extract::State;
use axum::http::StatusCode;
use axum::http::header::CONTENT_TYPE;
use axum::response::{IntoResponse, Response};

/// The text format of OpenMetrics, which Prometheus reads as its own.
const FORMAT: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// All figures. Those of rows are missing while the database can't be read.
pub(super) async fn page(State(pages): State<Pages>) -> Response {
    match exposed(&pages.context, &pages.last).await {
        Ok(text) => ([(CONTENT_TYPE, FORMAT)], text).into_response(),
        Err(error) => {
            tracing::error!(%error, "the figures can't be written");
            StatusCode::INTERNAL_SERVER_ERROR.into_response()
        }
    }
}
