//! Figures for operators, in the names and units of Prometheus.
//!
//! Counters are those of the process. What is in rows is read when someone asks (`http/figures.rs`), so it is the same on all
//! coordinators of a database: a dashboard takes the largest value and not the sum.

mod trainings;

use crate::clock::{Clock, SystemClock};
use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::histogram::Histogram;
use prometheus_client::registry::{Registry, Unit};
use std::sync::LazyLock;
use std::time::Duration;
use trainings::Trainings;

/// The figures of this process.
pub static METRICS: LazyLock<Metrics> = LazyLock::new(Metrics::new);

/// What is counted where it happens.
#[derive(Debug)]
pub struct Metrics {
    registry: Registry,
    /// Leases that were given.
    leases: Family<OfKind, Counter>,
    /// Leases that ran out.
    lease_losses: Counter,
    commit: Histogram,
    /// Running trainings that report to this process.
    pub trainings: Trainings,
    checkpoint: Histogram,
    checkpoint_bytes: Counter,
    uploaded: Counter,
    object_errors: Counter,
    collected_bytes: Counter,
    last_collection: Gauge,
    calls: Family<OfMethod, Counter>,
    refused: Counter,
    traces_dropped: Counter,
}

/// A label for the kind of a job.
#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
pub struct OfKind {
    /// Its name.
    pub kind: &'static str,
}

/// A label for a method of the contract.
#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct OfMethod {
    method: String,
}

/// Bounds of a histogram of seconds.
fn seconds(bounds: &[f64]) -> Histogram {
    Histogram::new(bounds.iter().copied())
}

impl Metrics {
    fn new() -> Self {
        let mut registry = Registry::with_prefix("yoto");
        let leases = Family::default();
        registry.register("leases", "Leases given to workers", leases.clone());
        let lease_losses = Counter::default();
        let help = "Leases that ran out, because a worker was lost";
        registry.register("lease_losses", help, lease_losses.clone());
        let commit = seconds(&[0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0]);
        let help = "Duration of commits to the database";
        registry.register_with_unit("commit", help, Unit::Seconds, commit.clone());
        let checkpoint = seconds(&[0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0]);
        let help = "Time from the end of a step until its checkpoint is published";
        registry.register_with_unit("checkpoint", help, Unit::Seconds, checkpoint.clone());
        let bytes = |registry: &mut Registry, name: &str, help: &str| {
            let counter = Counter::default();
            registry.register_with_unit(name, help, Unit::Bytes, counter.clone());
            counter
        };
        let checkpoint_bytes = bytes(&mut registry, "checkpoint", "Size of published checkpoints");
        let uploaded = bytes(&mut registry, "uploaded", "Bytes that uploads have sent");
        let collected_bytes = bytes(&mut registry, "collected", "Size of removed garbage");
        let object_errors = Counter::default();
        let help = "Reads and writes of objects that failed";
        registry.register("object_errors", help, object_errors.clone());
        let last_collection = Gauge::default();
        let help = "When this process last collected garbage, since 1970";
        registry.register_with_unit(
            "last_collection_timestamp",
            help,
            Unit::Seconds,
            last_collection.clone(),
        );
        let calls = Family::default();
        registry.register("calls", "Calls by method", calls.clone());
        let refused = Counter::default();
        let help = "Calls and connections beyond a limit";
        registry.register("refused", help, refused.clone());
        let traces_dropped = Counter::default();
        let help = "Ended jobs whose traces no collector has taken";
        registry.register("traces_dropped", help, traces_dropped.clone());
        let trainings = Trainings::registered(&mut registry);
        Self {
            registry,
            leases,
            lease_losses,
            commit,
            trainings,
            checkpoint,
            checkpoint_bytes,
            uploaded,
            object_errors,
            collected_bytes,
            last_collection,
            calls,
            refused,
            traces_dropped,
        }
    }

    /// A worker got a lease.
    pub fn leased(&self, kind: &'static str) {
        self.leases.get_or_create(&OfKind { kind }).inc();
    }

    /// A worker was lost with its lease of `job`, `jobs/{id}`.
    pub fn lease_lost(&self, job: &str) {
        self.lease_losses.inc();
        self.trainings.ended(job);
    }

    /// A transaction was committed.
    pub fn committed(&self, took: Duration) {
        self.commit.observe(took.as_secs_f64());
    }

    /// A checkpoint was published; `took` is what its worker says.
    pub fn checkpoint(&self, bytes: u64, took: f64) {
        self.checkpoint_bytes.inc_by(bytes);
        // Workers of earlier versions say nothing.
        if took.is_finite() && took > 0.0 {
            self.checkpoint.observe(took);
        }
    }

    /// All figures.
    pub fn registry(&self) -> &Registry {
        &self.registry
    }

    /// Bytes of an upload have arrived.
    pub fn uploaded(&self, bytes: usize) {
        self.uploaded.inc_by(bytes as u64);
    }

    /// The object store has failed.
    pub fn objects_failed(&self) {
        self.object_errors.inc();
    }

    /// A collection has ended, which removed `bytes`.
    pub fn collected(&self, bytes: u64) {
        self.collected_bytes.inc_by(bytes);
        self.last_collection.set(SystemClock.now() as i64);
    }

    /// When this process last collected garbage, seconds since 1970.
    pub fn last_collected(&self) -> Option<f64> {
        let at = self.last_collection.get();
        (at > 0).then_some(at as f64)
    }

    /// A call of the method at `path`, which is one of the contract.
    pub fn called(&self, path: &str) {
        let method = path.trim_start_matches('/').to_owned();
        self.calls.get_or_create(&OfMethod { method }).inc();
    }

    /// A call or a connection was refused.
    pub fn refused(&self) {
        self.refused.inc();
    }

    /// The traces of this number of ended jobs are given up.
    pub fn traces_dropped(&self, number: usize) {
        self.traces_dropped.inc_by(number as u64);
    }
}
