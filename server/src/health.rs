//! Health of the service: SERVING while writes to the database succeed.
//!
//! With a full disk or a locked file, reads still succeed, so each check writes: it records the time.

use crate::context::Context;
use crate::methods::services;
use std::sync::Arc;
use std::time::Duration;
use tokio::time::{sleep, timeout};
use tonic_health::ServingStatus;
use tonic_health::server::HealthReporter;

/// Longest interval between two checks while writes fail.
const RECHECK: Duration = Duration::from_secs(1);
/// Time limit of a write, in intervals between checks.
const PATIENCE: u32 = 2;

/// Sets the status of every service of the contract, and that of the server as a whole, whose name is empty.
pub async fn set(reporter: &HealthReporter, status: ServingStatus) {
    for name in services().chain([""]) {
        reporter.set_service_status(name, status).await;
    }
}

/// Writes the time to the database at each [`crate::ServerConfig::health_interval`], and records whether that
/// succeeded, until the coordinator stops.
pub async fn run(context: Arc<Context>) {
    let every = context.config.health_interval;
    loop {
        let worked = *context.writable.borrow();
        tokio::select! {
            () = context.stop.cancelled() => return,
            () = sleep(if worked { every } else { every.min(RECHECK) }) => {}
        }
        // Not cancelled at the limit: whether a step of the clock was recorded would be unknown.
        let write = context.store.keep_time();
        tokio::pin!(write);
        let written = match timeout(every * PATIENCE, &mut write).await {
            Ok(written) => written,
            Err(late) => {
                found(&context, Some(&late));
                write.await
            }
        };
        match written {
            Ok(_) => found(&context, None),
            Err(error) => found(&context, Some(&error)),
        }
    }
}

/// Records the outcome of a check. A change is logged, and reaches all listeners.
fn found(context: &Context, fault: Option<&dyn std::error::Error>) {
    let works = fault.is_none();
    let news = context.writable.send_if_modified(|known| {
        let news = *known != works;
        *known = works;
        news
    });
    match fault {
        _ if !news => {}
        None => tracing::info!("the database can be written again: the service is healthy"),
        Some(error) => {
            tracing::error!(%error, "the database can't be written: the service is not healthy");
        }
    }
}

/// Sets the status of every service to what [`run`] finds. Never returns.
pub async fn follow(context: &Context, reporter: &HealthReporter) {
    let mut writable = context.writable.subscribe();
    loop {
        let status = match *writable.borrow_and_update() {
            true => ServingStatus::Serving,
            false => ServingStatus::NotServing,
        };
        set(reporter, status).await;
        if writable.changed().await.is_err() {
            // Unreachable: the context owns the sender.
            std::future::pending::<()>().await;
        }
    }
}
