//! Tells what a page has cost, in the header `Server-Timing`, which browsers show beside the request.

use axum::extract::Request;
use axum::http::{HeaderName, HeaderValue};
use axum::middleware::Next;
use axum::response::Response;
use std::time::Instant;
use yoto_process::statements::counted;

const SERVER_TIMING: HeaderName = HeaderName::from_static("server-timing");

/// Adds the number of statements that the page sent to the database, and the time until its answer.
pub(crate) async fn told(request: Request, next: Next) -> Response {
    let began = Instant::now();
    let (mut answer, statements) = counted(next.run(request)).await;
    let milliseconds = 1e3 * began.elapsed().as_secs_f64();
    let text = format!("db;desc=\"{statements} statements\", total;dur={milliseconds:.1}");
    if let Ok(text) = HeaderValue::try_from(text) {
        answer.headers_mut().insert(SERVER_TIMING, text);
    }
    answer
}
