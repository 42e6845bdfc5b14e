//! When a training saves, and how: the trainer writes its files to this machine's disk, and a thread
//! copies them to the store while the training continues.

use crate::jobs::checkpoint::{Saved, publish};
use crate::jobs::{JobContext, JobFailure};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Time from the start of a lease to its first checkpoint: a crash loses seconds, and a job that saves
/// does not count as one that kills its workers.
const FIRST: Duration = Duration::from_secs(5);
/// Shortest time between two checkpoints that the training chooses by itself.
const SHORTEST: Duration = Duration::from_secs(30);
/// Share of a training's time that its checkpoints, and the validations that come with them, may take.
const SHARE: f64 = 0.03;
/// Share of the interval between two checkpoints after which the next one may come early.
const NEAR: f64 = 0.5;

/// When the next checkpoint is due.
#[derive(Debug)]
pub(super) struct Rhythm {
    /// Time between two checkpoints that the user has chosen.
    wanted: Option<Duration>,
    /// End of the last checkpoint, or the start of the lease.
    since: Instant,
    /// Whether this lease has saved yet.
    first: bool,
    /// Time that the training stood still for the last checkpoint.
    cost: Duration,
}

impl Rhythm {
    pub(super) fn new(wanted: Option<Duration>, now: Instant) -> Self {
        Self {
            wanted,
            since: now,
            first: true,
            cost: Duration::ZERO,
        }
    }

    /// Time between two checkpoints.
    pub(super) fn every(&self) -> Duration {
        let own = self.cost.div_f64(SHARE).max(SHORTEST);
        self.wanted.unwrap_or(own)
    }

    /// Whether a checkpoint is due at `now`.
    pub(super) fn is_due(&self, now: Instant) -> bool {
        let wait = match self.first {
            true => FIRST.min(self.every()),
            false => self.every(),
        };
        now.saturating_duration_since(self.since) >= wait
    }

    /// Whether a checkpoint at `now` may come early.
    pub(super) fn is_near(&self, now: Instant) -> bool {
        !self.first && now.saturating_duration_since(self.since) >= self.every().mul_f64(NEAR)
    }

    /// Whether the first checkpoint of the lease is still to come, for which nothing is measured.
    pub(super) fn is_first(&self) -> bool {
        self.first
    }

    /// A checkpoint was written until `now`, for which the training stood still for `cost`.
    pub(super) fn saved(&mut self, now: Instant, cost: Duration) {
        self.since = now;
        self.first = false;
        self.cost = cost;
    }
}

/// A checkpoint on its way to the store; one at a time.
#[derive(Debug)]
pub(super) struct Upload {
    step: u64,
    thread: JoinHandle<Result<u64, JobFailure>>,
}

impl Upload {
    /// Starts to copy the files in `folder` to the store, and to publish them.
    ///
    /// # Errors
    /// When the system has no more threads.
    pub(super) fn start(
        context: &JobContext,
        folder: TempDir,
        saved: Saved,
    ) -> Result<Self, JobFailure> {
        let context = context.clone();
        let step = saved.step;
        let thread = std::thread::Builder::new()
            .name(format!("checkpoint {step}"))
            .spawn(move || publish(&context, folder.path(), &saved))
            .map_err(|error| JobFailure::machine("starting to save", &error))?;
        Ok(Self { step, thread })
    }

    /// Whether it has ended.
    pub(super) fn has_ended(&self) -> bool {
        self.thread.is_finished()
    }

    /// Waits for its end; step and bytes of the published checkpoint.
    ///
    /// # Errors
    /// Faults of the store, or of the lease.
    pub(super) fn wait(self) -> Result<(u64, u64), JobFailure> {
        let step = self.step;
        let published = self.thread.join().unwrap_or_else(|_| {
            Err(JobFailure::Failed {
                code: "INTERNAL",
                message: format!("publishing the checkpoint of step {step} panicked"),
            })
        });
        published.map(|bytes| (step, bytes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn seconds(seconds: u64) -> Duration {
        Duration::from_secs(seconds)
    }

    #[test]
    fn the_first_checkpoint_comes_within_seconds_and_the_others_by_their_cost() {
        let start = Instant::now();
        let mut rhythm = Rhythm::new(None, start);
        assert!(!rhythm.is_due(start + seconds(4)) && rhythm.is_due(start + seconds(5)));
        let first = start + seconds(6);
        rhythm.saved(first, Duration::from_millis(300));
        assert!(!rhythm.is_due(first + seconds(29)) && rhythm.is_due(first + seconds(30)));
        // A checkpoint of nearly a gigabyte, with validation: three in a hundred.
        rhythm.saved(first, seconds(12));
        assert!(!rhythm.is_due(first + seconds(399)) && rhythm.is_due(first + seconds(401)));
    }

    #[test]
    fn a_checkpoint_may_come_early_but_not_the_first() {
        let start = Instant::now();
        let mut rhythm = Rhythm::new(Some(seconds(15)), start);
        assert!(!rhythm.is_near(start + seconds(14)));
        rhythm.saved(start, Duration::ZERO);
        assert!(!rhythm.is_near(start + seconds(7)) && rhythm.is_near(start + seconds(8)));
        assert!(!rhythm.is_due(start + seconds(8)));
    }

    #[test]
    fn a_chosen_interval_is_kept_whatever_it_costs() {
        let start = Instant::now();
        let mut rhythm = Rhythm::new(Some(seconds(1)), start);
        assert!(rhythm.is_due(start + seconds(1)));
        rhythm.saved(start, seconds(12));
        assert_eq!(rhythm.every(), seconds(1));
        assert!(rhythm.is_due(start + seconds(1)));
    }
}
