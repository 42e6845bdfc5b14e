//! When each part of a model starts, and learning rates over a run, in fractions of the run: runs
//! of a minute and of a week have the same stages.

use super::ConfigError;
use serde::{Deserialize, Serialize};

/// Times in a run, each a fraction of it: 0 is the first step, 1 the end; greater values are never
/// reached.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Schedule {
    /// Steps of a run without a given budget.
    pub steps: u64,
    /// Learning rates rise from a fiftieth until here, so that Adam's moments settle first; 0:
    /// they start whole.
    pub warm_up: f64,
    /// Start of pose correction.
    pub correction: f64,
    /// Start of non-rigid motion.
    pub non_rigid: f64,
    /// Time at which all bands of the non-rigid field are open.
    pub all_bands: f64,
    /// Learning rates at the end of the run, relative to their start.
    pub final_rate: f64,
    /// When a run continues a trained model, its learning rates start later in the schedule, at most at this fraction of
    /// it: a short run at full rates loses more than it learns (docs/research/tiers-experiments.md).
    #[serde(default)]
    pub restart: f64,
}

/// Iterations of the paper's training, to which its other times are relative.
const PAPER_STEPS: f64 = 400_000.0;

/// Share of the learning rates that a warm-up starts with.
const WARM_START: f64 = 0.02;

impl Schedule {
    /// The paper's and HumanNeRF's (`configs/default.yaml`): the
    /// non-rigid field from iteration 10,000, whole from 50,000; rates × 0.1^(t / 500,000).
    pub fn paper() -> Self {
        Self {
            steps: PAPER_STEPS as u64,
            warm_up: 0.0,
            correction: 0.0,
            non_rigid: 10_000.0 / PAPER_STEPS,
            all_bands: 50_000.0 / PAPER_STEPS,
            final_rate: 0.1f64.powf(PAPER_STEPS / 500_000.0),
            restart: 0.0,
        }
    }

    /// This schedule with every part of the model fully active from the first step.
    pub fn all_at_once(self) -> Self {
        Self {
            correction: 0.0,
            non_rigid: 0.0,
            all_bands: 0.0,
            ..self
        }
    }

    /// Checks all fields.
    ///
    /// # Errors
    /// Names the first field that is out of its range.
    pub fn check(&self) -> Result<(), ConfigError> {
        let fail = |field, message: &str| {
            Err(ConfigError::Field {
                field,
                message: message.into(),
            })
        };
        if self.steps == 0 {
            return fail("schedule.steps", "must be at least 1");
        }
        for (field, share) in [
            ("schedule.warm_up", self.warm_up),
            ("schedule.correction", self.correction),
            ("schedule.non_rigid", self.non_rigid),
            ("schedule.all_bands", self.all_bands),
        ] {
            if !(share.is_finite() && share >= 0.0) {
                return fail(
                    field,
                    "must be a fraction of the run: 0 or more, above 1 for never",
                );
            }
        }
        if self.all_bands < self.non_rigid {
            return fail(
                "schedule.all_bands",
                "must not come before schedule.non_rigid",
            );
        }
        if !(self.final_rate > 0.0 && self.final_rate <= 1.0) {
            return fail("schedule.final_rate", "must be above 0 and at most 1");
        }
        if !(0.0..1.0).contains(&self.restart) {
            return fail("schedule.restart", "must be a fraction of the run below 1");
        }
        Ok(())
    }

    /// A start that no run reaches.
    pub const NEVER: f64 = 2.0;

    /// Whether poses are corrected at `progress`.
    pub fn corrects(&self, progress: f64) -> bool {
        progress >= self.correction
    }

    /// Whether points have non-rigid motion at `progress`.
    pub fn moves_points(&self, progress: f64) -> bool {
        progress >= self.non_rigid
    }

    /// Number of open bands at `progress`, of `bands`; the fraction is the opening of the last one
    /// (HumanNeRF's α).
    pub fn open_bands(&self, progress: f64, bands: usize) -> f32 {
        let since = (progress - self.non_rigid).max(0.0);
        let span = self.all_bands - self.non_rigid;
        let share = match span > 0.0 {
            true => (since / span).min(1.0),
            false => f64::from(u8::from(self.moves_points(progress))),
        };
        (bands as f64 * share) as f32
    }

    /// Factor on the learning rates at `progress`.
    pub fn rate(&self, progress: f64) -> f64 {
        let warm = match self.warm_up > 0.0 {
            true => (WARM_START + (1.0 - WARM_START) * progress / self.warm_up).min(1.0),
            false => 1.0,
        };
        warm * self.final_rate.powf(progress.min(1.0))
    }

    /// Where the learning rates start when a run of length `run` continues a training of length `before`, in the same unit:
    /// at 0 if the run is at least as long, and later the shorter it is.
    pub fn begins_at(&self, before: f64, run: f64) -> f64 {
        (1.0 - run / before.max(f64::MIN_POSITIVE)).clamp(0.0, self.restart)
    }

    /// Names and states of the scheduled parts that are active at `progress`, for reports.
    pub fn active_parts(&self, progress: f64, bands: usize) -> Vec<String> {
        let mut parts = Vec::new();
        if self.corrects(progress) {
            parts.push("pose correction".to_owned());
        }
        if self.moves_points(progress) {
            let open = self.open_bands(progress, bands);
            parts.push(format!("non-rigid field ({open:.1} of {bands} bands)"));
        }
        parts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_paper_counts_iterations() {
        let schedule = Schedule::paper();
        schedule.check().expect("a schedule");
        let at = |iteration: u32| f64::from(iteration) / PAPER_STEPS;
        assert!(!schedule.moves_points(at(9_999)));
        assert!(schedule.moves_points(at(10_000)));
        assert_eq!(schedule.open_bands(at(10_000), 6), 0.0);
        assert_eq!(schedule.open_bands(at(30_000), 6), 3.0);
        assert_eq!(schedule.open_bands(at(50_000), 6), 6.0);
        assert_eq!(schedule.open_bands(at(400_000), 6), 6.0);
        for iteration in [0, 1, 100_000, 400_000] {
            let expected = 0.1f64.powf(f64::from(iteration) / 500_000.0);
            assert!((schedule.rate(at(iteration)) - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn rates_rise_and_then_fall() {
        let schedule = Schedule {
            warm_up: 0.1,
            final_rate: 0.01,
            ..Schedule::paper()
        };
        assert_eq!(schedule.rate(0.0), 0.02);
        assert!((schedule.rate(0.05) - 0.51 * 0.01f64.powf(0.05)).abs() < 1e-12);
        assert!((schedule.rate(0.5) - 0.1).abs() < 1e-12);
        assert!((schedule.rate(1.0) - 0.01).abs() < 1e-12);
    }

    #[test]
    fn a_short_run_that_goes_on_begins_with_lower_rates() {
        let schedule = Schedule {
            warm_up: 0.1,
            final_rate: 0.01,
            restart: 0.5,
            ..Schedule::paper()
        };
        schedule.check().expect("a schedule");
        let begins = |run| schedule.begins_at(60.0, run);
        assert_eq!(
            [120.0, 60.0, 45.0, 6.0, 0.0].map(begins),
            [0.0, 0.0, 0.25, 0.5, 0.5]
        );
        assert_eq!(schedule.begins_at(0.0, 5.0), 0.0);
        assert_eq!(Schedule::paper().begins_at(60.0, 6.0), 0.0);
        for bad in [-0.1, 1.0, f64::NAN] {
            let bad = Schedule {
                restart: bad,
                ..schedule.clone()
            };
            assert!(bad.check().is_err());
        }
    }

    #[test]
    fn bands_may_open_at_once() {
        let schedule = Schedule {
            non_rigid: 0.5,
            all_bands: 0.5,
            ..Schedule::paper()
        };
        assert_eq!(schedule.open_bands(0.49, 4), 0.0);
        assert_eq!(schedule.open_bands(0.5, 4), 4.0);
    }

    #[test]
    fn numbers_of_no_run_are_named() {
        type Change = fn(&mut Schedule);
        let cases: [(Change, &str); 5] = [
            (|it| it.steps = 0, "schedule.steps"),
            (|it| it.warm_up = -0.1, "schedule.warm_up"),
            (|it| it.correction = f64::NAN, "schedule.correction"),
            (|it| it.all_bands = 0.0, "schedule.all_bands"),
            (|it| it.final_rate = 0.0, "schedule.final_rate"),
        ];
        for (change, field) in cases {
            let mut schedule = Schedule::paper();
            change(&mut schedule);
            let error = schedule.check().expect_err(field).to_string();
            assert!(error.starts_with(field), "{error}");
        }
        let never = Schedule {
            correction: 2.0,
            ..Schedule::paper()
        };
        never.check().expect("never is a moment, too");
        assert!(!never.corrects(1.0));
    }
}
