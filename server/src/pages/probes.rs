//! Whether the process lives, and whether it can serve. Both answer from what the health check found last, so that many
//! probes cost the database nothing.

use crate::context::Context;
use axum::extract::State;
use axum::http::StatusCode;
use std::sync::Arc;

/// 200 as long as the process answers.
pub(super) async fn lives() -> &'static str {
    "alive\n"
}

/// 200 if the last write to the database succeeded and the object store has answered; 503 otherwise, and once the
/// coordinator is about to end.
pub(super) async fn is_ready(State(context): State<Arc<Context>>) -> (StatusCode, String) {
    let faults = context.health.found().faults();
    match faults.is_empty() {
        true => (StatusCode::OK, "ready\n".to_owned()),
        false => {
            let text = format!("not ready: {}\n", faults.join("; "));
            (StatusCode::SERVICE_UNAVAILABLE, text)
        }
    }
}
