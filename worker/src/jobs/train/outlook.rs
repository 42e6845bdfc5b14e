//! The time that a training still takes, with its validations and checkpoints: the budget counts
//! steps only.

use std::time::{Duration, Instant};
use yoto_avatar::train::TrainProgress;

/// Validations over the whole budget.
pub(super) const VALIDATIONS: f64 = 8.0;

/// Seconds of the latest validation and of the latest checkpoint.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Outlook {
    validation: f64,
    checkpoint: f64,
    /// Largest share that was reported: a bar does not move backwards.
    told: f64,
}

impl Outlook {
    /// A validation took this long.
    pub(super) fn validated(&mut self, took: Duration) {
        self.validation = took.as_secs_f64();
    }

    /// How long the latest validation took.
    pub(super) fn validation(&self) -> Duration {
        Duration::from_secs_f64(self.validation)
    }

    /// A checkpoint took this long.
    pub(super) fn saved(&mut self, took: Duration) {
        self.checkpoint = took.as_secs_f64();
    }

    /// Seconds left; 0 while the speed of steps is unknown. A checkpoint is written every `every`, and
    /// one at the end.
    pub(super) fn seconds_left(&self, now: &TrainProgress, every: Duration) -> f64 {
        if now.steps_per_second == 0.0 {
            return 0.0;
        }
        let steps = now.seconds_left;
        let checkpoints = (steps / every.as_secs_f64()).floor() + 1.0;
        let validations = (VALIDATIONS * (1.0 - now.fraction)).floor() + checkpoints;
        steps + validations * self.validation + checkpoints * self.checkpoint
    }

    /// The share of a job's time that has passed since `began`, when `before` of it had, with
    /// `left` seconds to go. It never falls, and is below 1 until the job ends.
    pub(super) fn share(&mut self, before: f64, began: Instant, left: f64) -> f64 {
        let spent = began.elapsed().as_secs_f64();
        let share = match left > 0.0 {
            true => before + (1.0 - before) * spent / (spent + left),
            false => before,
        };
        self.told = self.told.max(share).min(0.999);
        self.told
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn now(fraction: f64, seconds_left: f64) -> TrainProgress {
        TrainProgress {
            steps_per_second: 10.0,
            fraction,
            seconds_left,
            ..TrainProgress::default()
        }
    }

    #[test]
    fn validations_and_checkpoints_take_time_too() {
        let mut outlook = Outlook::default();
        let every = Duration::from_secs(30);
        assert_eq!(outlook.seconds_left(&now(0.5, 30.0), every), 30.0);
        outlook.validated(Duration::from_secs(2));
        outlook.saved(Duration::from_secs(1));
        // Two checkpoints with a validation each, and the four of the second half.
        assert_eq!(outlook.seconds_left(&now(0.5, 30.0), every), 44.0);
        assert_eq!(outlook.seconds_left(&now(1.0, 0.0), every), 3.0);
        let unknown = TrainProgress::default();
        assert_eq!(outlook.seconds_left(&unknown, every), 0.0);
    }

    #[test]
    fn the_share_never_falls_and_ends_with_the_job() {
        let mut outlook = Outlook::default();
        let began = Instant::now() - Duration::from_secs(10);
        let half = outlook.share(0.0, began, 10.0);
        assert!((half - 0.5).abs() < 0.01, "{half}");
        assert_eq!(outlook.share(0.0, began, 1000.0), half);
        assert_eq!(outlook.share(0.99, began, 1e-9), 0.999);
    }
}
