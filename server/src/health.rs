//! Health of the service: SERVING while writes to the database succeed.
//!
//! With a full disk or a locked file, reads still succeed, so each check writes: it records the time.

use crate::api::{
    JobApi, ModelApi, ObjectApi, RenderApi, StatusApi, StorageApi, SubjectApi, UploadApi, WorkerApi,
};
use crate::context::Context;
use std::sync::Arc;
use std::time::Duration;
use tokio::time::{sleep, timeout};
use tonic::server::NamedService;
use tonic_health::ServingStatus;
use tonic_health::server::HealthReporter;
use yoto_proto::v1::job_service_server::JobServiceServer;
use yoto_proto::v1::model_service_server::ModelServiceServer;
use yoto_proto::v1::object_service_server::ObjectServiceServer;
use yoto_proto::v1::render_service_server::RenderServiceServer;
use yoto_proto::v1::status_service_server::StatusServiceServer;
use yoto_proto::v1::storage_service_server::StorageServiceServer;
use yoto_proto::v1::subject_service_server::SubjectServiceServer;
use yoto_proto::v1::upload_service_server::UploadServiceServer;
use yoto_proto::v1::worker_service_server::WorkerServiceServer;

/// Names of the services whose health is reported. The empty name is the server as a whole.
const NAMES: [&str; 10] = [
    "",
    <SubjectServiceServer<SubjectApi> as NamedService>::NAME,
    <UploadServiceServer<UploadApi> as NamedService>::NAME,
    <ModelServiceServer<ModelApi> as NamedService>::NAME,
    <JobServiceServer<JobApi> as NamedService>::NAME,
    <ObjectServiceServer<ObjectApi> as NamedService>::NAME,
    <RenderServiceServer<RenderApi> as NamedService>::NAME,
    <StatusServiceServer<StatusApi> as NamedService>::NAME,
    <StorageServiceServer<StorageApi> as NamedService>::NAME,
    <WorkerServiceServer<WorkerApi> as NamedService>::NAME,
];
/// Longest interval between two checks while writes fail.
const RECHECK: Duration = Duration::from_secs(1);
/// Time limit of a write, in intervals between checks.
const PATIENCE: u32 = 2;

/// Sets the status of every service.
pub async fn set(reporter: &HealthReporter, status: ServingStatus) {
    for name in NAMES {
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
