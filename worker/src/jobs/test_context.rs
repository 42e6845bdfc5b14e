//! A job's context without a coordinator: objects in memory, and a lease that does not expire.

use super::JobContext;
use crate::agent::control::JobControl;
use object_store::memory::InMemory;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::runtime::Handle;
use tokio::sync::watch;
use tonic::transport::Endpoint;
use yoto_proto::key::connection;
use yoto_proto::worker::v1::Claim;
use yoto_proto::worker::v1::worker_service_client::WorkerServiceClient;

/// The context of `jobs/test` under token 3. Call it inside a runtime.
pub(crate) fn context() -> JobContext {
    // There is no server, so a test that calls the coordinator fails.
    let channel = Endpoint::from_static("http://127.0.0.1:1").connect_lazy();
    JobContext {
        claim: Claim {
            job: "jobs/test".into(),
            worker: "workers/test".into(),
            token: 3,
        },
        device: yoto_device::pick(),
        control: Arc::new(JobControl::new(Instant::now() + Duration::from_secs(600))),
        ingest: Arc::default(),
        lpips: None,
        scratch: std::env::temp_dir(),
        objects: yoto_objects::Objects::over(Arc::new(InMemory::new())),
        client: WorkerServiceClient::new(connection(channel, None)),
        progress: watch::Sender::default(),
        runtime: Handle::current(),
        pace: Default::default(),
    }
}
