//! Figures that are read when someone asks for them: rows of the database, the disk, the health.

use crate::context::Context;
use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::encoding::text::{encode_eof, encode_registry};
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::registry::{Registry, Unit};
use std::fmt;
use std::sync::atomic::AtomicU64;
use std::time::{Duration, Instant};
use yoto_process::metrics::{METRICS, OfKind};
use yoto_store::{OpenJobs, StoreError};

/// Age up to which a text is given again: however many ask, the database is read once in this time.
const FRESH: Duration = Duration::from_secs(1);

/// The last text, and when it was written.
pub(crate) type LastText = tokio::sync::Mutex<Option<(Instant, String)>>;

type Real = Gauge<f64, AtomicU64>;

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct OfState {
    kind: &'static str,
    state: &'static str,
}

/// The text of all figures; one that was read within the last second is given again.
///
/// # Errors
/// Never in practice: when a string can't be written to.
pub(crate) async fn exposed(context: &Context, last: &LastText) -> Result<String, fmt::Error> {
    let mut last = last.lock().await;
    if let Some((at, text)) = &*last
        && at.elapsed() < FRESH
    {
        return Ok(text.clone());
    }
    let text = read(context).await?;
    *last = Some((Instant::now(), text.clone()));
    Ok(text)
}

/// The text of all figures as they are now.
async fn read(context: &Context) -> Result<String, fmt::Error> {
    let mut text = String::new();
    encode_registry(&mut text, METRICS.registry())?;
    encode_registry(&mut text, &read_now(context).await)?;
    encode_eof(&mut text)?;
    Ok(text)
}

/// The figures beside those of [`METRICS`]. Those of rows are missing while the database can't be read.
pub(crate) async fn read_now(context: &Context) -> Registry {
    let mut registry = Registry::with_prefix("yoto");
    let ready = Gauge::<i64>::default();
    ready.set(i64::from(context.health.found().faults().is_empty()));
    registry.register("ready", "1 if this coordinator can serve", ready);
    if let Some(room) = context.storage.place.room() {
        for (name, bytes) in [("disk_free", room.free), ("disk_size", room.total)] {
            let gauge = Gauge::<i64>::default();
            gauge.set(i64::try_from(bytes).unwrap_or(i64::MAX));
            registry.register_with_unit(name, "Disk of the objects", Unit::Bytes, gauge);
        }
    }
    if let Err(error) = read_rows(context, &mut registry).await {
        tracing::warn!(%error, "the queue can't be read for its figures");
    }
    registry
}

async fn read_rows(context: &Context, registry: &mut Registry) -> Result<(), StoreError> {
    let counts = context.store.queue_figures().await?;
    let jobs = Family::<OfState, Gauge>::default();
    let oldest = Family::<OfKind, Real>::default();
    for OpenJobs {
        kind,
        queued,
        running,
        oldest_seconds,
    } in counts.open
    {
        let kind = kind.as_str();
        for (state, count) in [("queued", queued), ("running", running)] {
            let gauge = jobs.get_or_create_owned(&OfState { kind, state });
            gauge.set(i64::try_from(count).unwrap_or(i64::MAX));
        }
        oldest
            .get_or_create_owned(&OfKind { kind })
            .set(oldest_seconds);
    }
    registry.register("jobs", "Open jobs of all tenants, by kind and state", jobs);
    let help = "Age of the oldest queued job of a kind; 0 without any";
    registry.register_with_unit("queue_oldest", help, Unit::Seconds, oldest);
    let draining = Gauge::<i64>::default();
    draining.set(i64::from(context.store.draining().await?.is_some()));
    registry.register(
        "draining",
        "1 while the service takes no new jobs",
        draining,
    );
    let workers = Gauge::<i64>::default();
    workers.set(i64::try_from(counts.workers).unwrap_or(i64::MAX));
    registry.register(
        "workers",
        "Workers that have a job or have asked for one lately",
        workers,
    );
    Ok(())
}
