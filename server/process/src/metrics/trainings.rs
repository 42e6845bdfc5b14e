//! Figures of the trainings whose workers report to this process. Labels name no jobs: there are many of them.

use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::histogram::Histogram;
use prometheus_client::registry::{Registry, Unit};
use std::collections::HashMap;
use std::sync::atomic::AtomicU64;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use yoto_proto::v1::Progress;

/// Silence after which a training counts as gone: its worker may report to another coordinator.
const GONE: Duration = Duration::from_secs(60);

/// What trainings report.
#[derive(Debug)]
pub struct Trainings {
    step: Histogram,
    skipped: Counter,
    rollbacks: Counter,
    /// The lowest one of the running trainings; 1 without any.
    live: Gauge<f64, AtomicU64>,
    running: Mutex<HashMap<String, Last>>,
}

/// What a training has reported last.
#[derive(Debug)]
struct Last {
    skipped: u64,
    rollbacks: u64,
    live: f64,
    at: Instant,
}

impl Trainings {
    pub(super) fn registered(registry: &mut Registry) -> Self {
        let step = Histogram::new([0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0]);
        let help = "Duration of a training's steps, at each report";
        registry.register_with_unit("train_step", help, Unit::Seconds, step.clone());
        let skipped = Counter::default();
        let help = "Steps skipped because loss or gradients were not finite";
        registry.register("train_skipped_steps", help, skipped.clone());
        let rollbacks = Counter::default();
        let help = "Returns of trainings to an earlier state";
        registry.register("train_rollbacks", help, rollbacks.clone());
        let live = Gauge::<f64, AtomicU64>::default();
        live.set(1.0);
        let help = "Lowest share of live rays or splats of the running trainings";
        registry.register("train_live_fraction", help, live.clone());
        Self {
            step,
            skipped,
            rollbacks,
            live,
            running: Mutex::default(),
        }
    }

    /// The training `job`, `jobs/{id}`, has reported.
    pub fn reported(&self, job: &str, progress: &Progress) {
        if progress.steps_per_second > 0.0 {
            self.step.observe(progress.steps_per_second.recip());
        }
        let last = Last {
            skipped: progress.skipped_steps,
            rollbacks: progress.rollbacks,
            live: progress.live_fraction,
            at: Instant::now(),
        };
        self.change(|running| {
            // The counts of a training go on after a checkpoint, so the first report counts for nothing.
            if let Some(before) = running.get(job) {
                self.skipped
                    .inc_by(last.skipped.saturating_sub(before.skipped));
                self.rollbacks
                    .inc_by(last.rollbacks.saturating_sub(before.rollbacks));
            }
            running.insert(job.to_owned(), last);
        });
    }

    /// The job no longer runs.
    pub fn ended(&self, job: &str) {
        self.change(|running| {
            running.remove(job);
        });
    }

    fn change(&self, change: impl FnOnce(&mut HashMap<String, Last>)) {
        let mut running = self.running.lock().unwrap_or_else(PoisonError::into_inner);
        change(&mut running);
        running.retain(|_, last| last.at.elapsed() < GONE);
        let live = running.values().map(|it| it.live);
        self.live.set(live.fold(1.0, f64::min));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_differences_and_the_lowest_live_share_is_told() {
        let trainings = Trainings::registered(&mut Registry::default());
        let report = |job: &str, skipped_steps, live_fraction| {
            let progress = Progress {
                skipped_steps,
                live_fraction,
                steps_per_second: 4.0,
                ..Progress::default()
            };
            trainings.reported(job, &progress);
        };
        report("jobs/1", 40, 0.5);
        assert_eq!((trainings.skipped.get(), trainings.live.get()), (0, 0.5));
        report("jobs/1", 43, 0.9);
        report("jobs/2", 1, 0.7);
        assert_eq!((trainings.skipped.get(), trainings.live.get()), (3, 0.7));
        assert_eq!((trainings.step.count(), trainings.step.sum()), (3, 0.75));
        trainings.ended("jobs/2");
        assert_eq!(trainings.live.get(), 0.9);
    }
}
