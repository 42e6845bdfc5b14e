//! A run: its budget, what it has used of it, and how it goes.

pub(crate) mod best;
pub(crate) mod checkpoint;
pub(crate) mod guard;
pub(crate) mod optimiser;
mod optimiser_file;
pub(crate) mod options;
pub(crate) mod parts;
pub(crate) mod progress;
pub(crate) mod validate;

use crate::config::Schedule;
use crate::loss::LossTerm;
use crate::render::SampleCounts;
use crate::train::run::checkpoint::ModelState;
use crate::train::run::options::{Budget, TrainOptions};
use crate::train::run::progress::TrainProgress;
use crate::train::run::validate::{Measured, Preview};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Weight of the newest value in smoothed figures.
const SMOOTHING: f64 = 0.02;

/// A budget of steps or seconds, and the steps and seconds of a model's life.
pub(crate) struct Run {
    options: TrainOptions,
    /// Steps over the model's life.
    step: u64,
    /// Seconds spent in steps over the model's life.
    seconds: f64,
    /// Completed fraction of the schedule before this run.
    schedule_progress: f64,
    /// Whether this budget continues with a model that was trained with the same people before.
    continues: bool,
    /// Steps of this budget.
    budget_steps: u64,
    /// Seconds of this budget spent in steps.
    budget_seconds: f64,
    progress: TrainProgress,
    /// Pictures of the last validation.
    previews: Vec<Preview>,
}

/// The position of a run before a step.
#[derive(Clone, Copy)]
pub(crate) struct Moment {
    /// Steps over the model's life.
    pub step: u64,
    /// Completed fraction of a run over the model's life, as [`Run::schedule_progress`] tells it.
    pub schedule_progress: f64,
    /// Used share of the budget, 0 to 1.
    pub fraction: f64,
}

impl Run {
    /// The run of `options` with the model in `saved`, whose seed it keeps.
    pub(super) fn new(
        saved: &ModelState,
        options: TrainOptions,
        continues: bool,
        progress: TrainProgress,
    ) -> Self {
        Self {
            step: saved.step,
            seconds: saved.train_seconds,
            schedule_progress: saved.schedule_progress,
            continues,
            budget_steps: options.used_steps,
            budget_seconds: options.used_seconds,
            progress,
            previews: Vec::new(),
            options: TrainOptions {
                seed: saved.seed,
                ..options
            },
        }
    }

    /// How to train, with the model's seed.
    pub(super) fn options(&self) -> &TrainOptions {
        &self.options
    }

    /// The position of the run.
    pub(super) fn moment(&self) -> Moment {
        Moment {
            step: self.step,
            schedule_progress: self.schedule_progress(),
            fraction: self.fraction(),
        }
    }

    /// Completed fraction of a run over the model's life, 0 to 1; it never decreases.
    pub(super) fn schedule_progress(&self) -> f64 {
        match self.options.learn.only() {
            // More of the shared weights would change everybody.
            Some(_) => self.schedule_progress,
            None => self.schedule_progress.max(self.fraction()),
        }
    }

    /// Used share of the budget, 0 to 1.
    pub(super) fn fraction(&self) -> f64 {
        let share = match self.options.budget {
            Budget::Seconds(seconds) => self.budget_seconds / seconds.max(f64::MIN_POSITIVE),
            Budget::Steps(steps) => self.budget_steps as f64 / steps.max(1) as f64,
        };
        share.min(1.0)
    }

    /// Whether the budget is used up.
    pub(super) fn is_over(&self) -> bool {
        self.fraction() >= 1.0
    }

    /// Factor on the learning rates of this step.
    pub(super) fn rate(&self, schedule: &Schedule) -> f64 {
        let begins = match (self.continues, self.options.budget) {
            (false, _) => 0.0,
            (true, Budget::Seconds(run)) => {
                let before = self.seconds - self.budget_seconds;
                schedule.begins_at(before, run)
            }
            (true, Budget::Steps(run)) => {
                let before = self.step.saturating_sub(self.budget_steps);
                schedule.begins_at(before as f64, run as f64)
            }
        };
        schedule.rate(begins + (1.0 - begins) * self.fraction())
    }

    /// The random generator of this step. It depends only on the seed and the number of the step, so that
    /// a resumed training draws the same numbers as an uninterrupted one.
    pub(super) fn stream(&self) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(self.options.seed);
        rng.set_stream(self.step);
        rng
    }

    /// Counts a step that took `seconds`.
    pub(super) fn count_step(&mut self, seconds: f64) {
        self.step += 1;
        self.budget_steps += 1;
        self.seconds += seconds;
        self.budget_seconds += seconds;
        let rate = 1.0 / seconds.max(1e-6);
        self.progress.steps_per_second = self.smoothed(self.progress.steps_per_second, rate);
        self.progress.step = self.step;
    }

    /// Adds the loss of a step, and the `values` of its `terms`, to the smoothed figures.
    pub(super) fn note_loss(&mut self, loss: f32, terms: &[LossTerm], values: &[f32]) {
        let steps = self.progress.step;
        self.progress.loss = smoothed(self.progress.loss, f64::from(loss), steps);
        self.progress
            .note_terms(terms, values, |old, new| smoothed(old, new, steps));
    }

    /// Adds the samples of a step.
    pub(super) fn note_samples(&mut self, counts: SampleCounts) {
        let share = counts.live_fraction();
        self.progress.live_fraction = self.smoothed(self.progress.live_fraction, share);
        self.progress.samples += counts;
    }

    /// Adds something for people to read.
    pub(super) fn note(&mut self, note: impl IntoIterator<Item = String>) {
        self.progress.notes.extend(note);
    }

    /// Notes for people.
    pub(super) fn notes(&self) -> &[String] {
        &self.progress.notes
    }

    /// Replaces the name of the objective in reports.
    pub(super) fn set_objective(&mut self, name: &'static str) {
        self.progress.objective = name;
    }

    /// Takes the results of a validation.
    pub(super) fn take_measured(&mut self, measured: Measured) {
        self.previews = measured.previews;
        self.progress.held_out = measured.held_out;
        self.progress.psnr_mask_box = measured.psnr_mask_box;
        if let Some(psnr) = measured.psnr {
            self.progress.psnr = Some(psnr);
            self.progress.ssim = measured.ssim;
        }
    }

    /// Pictures of the last validation.
    pub(super) fn previews(&self) -> &[Preview] {
        &self.previews
    }

    /// The progress of the run, without the figures of the model.
    pub(super) fn progress(&self) -> TrainProgress {
        let (total_steps, seconds_left) = match self.options.budget {
            Budget::Seconds(seconds) => (0, (seconds - self.budget_seconds).max(0.0)),
            Budget::Steps(steps) => {
                let left = steps.saturating_sub(self.budget_steps);
                (
                    self.step + left,
                    left as f64 / self.progress.steps_per_second.max(1e-6),
                )
            }
        };
        TrainProgress {
            step: self.step,
            total_steps,
            fraction: self.fraction(),
            seconds_left,
            train_seconds: self.budget_seconds,
            ..self.progress.clone()
        }
    }

    /// Writes what a checkpoint keeps of the run into `state`.
    pub(super) fn record(&self, state: &mut ModelState) {
        state.seed = self.options.seed;
        state.step = self.step;
        state.schedule_progress = self.schedule_progress();
        state.train_seconds = self.seconds;
        state.continues = self.continues;
    }

    fn smoothed(&self, old: f64, new: f64) -> f64 {
        smoothed(old, new, self.progress.step)
    }
}

/// Exponential moving average of a figure after `steps` steps.
fn smoothed(old: f64, new: f64, steps: u64) -> f64 {
    let weight = SMOOTHING.max(1.0 / (steps + 1) as f64);
    old + weight * (new - old)
}

#[cfg(test)]
impl Run {
    pub(crate) fn continues(&self) -> bool {
        self.continues
    }
}
