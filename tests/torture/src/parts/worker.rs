//! A worker with a faulty object store, and with a full disk on request.

use super::controls::Controls;
use super::store::FaultyStore;
use super::{asked_to_stop, disk};
use anyhow::{Context, Result};
use std::sync::Arc;
use url::Url;
use yoto_client::Addresses;
use yoto_objects::Objects;
use yoto_worker::{Worker, WorkerConfig};

/// Silence of a job after which its worker ends, seconds.
const SILENCE: f64 = 10.0;

/// Works until SIGTERM.
pub(super) async fn run(
    service: &str,
    objects: &Url,
    name: String,
    controls: Controls,
    largest_file: Option<u64>,
) -> Result<()> {
    if let Some(bytes) = largest_file {
        disk::limit(bytes)?;
    }
    let channel = Addresses::parse(service)
        .context("the addresses")?
        .connect_lazy();
    let picked = tokio::task::spawn_blocking(yoto_device::pick).await?;
    let objects = Objects::open(objects)?;
    let objects = objects.inside(|store| Arc::new(FaultyStore::new(store, controls.clone())));
    let config = WorkerConfig {
        display_name: name,
        idle_poll_seconds: 0.25,
        silence_seconds: SILENCE,
        scratch: controls.folder().join("scratch"),
        ..WorkerConfig::default()
    };
    let worker = Worker::with_objects(channel, objects, picked, config)?;
    worker.run(asked_to_stop()).await.context("working")?;
    Ok(())
}
