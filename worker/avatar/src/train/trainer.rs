//! The training loop's state: one call, one step.

use super::batch::{Scene, outcome};
use super::frame_order::FrameOrder;
use super::guard::{Guard, TrainState, Verdict};
use super::options::{Budget, TrainOptions};
use super::patches;
use super::people::TrainSubject;
use super::{TrainError, TrainProgress};
use crate::config::ModelConfig;
use crate::loss::{LossTerm, Objective};
use crate::render::frame::read;
use burn::optim::GradientsParams;
use burn::tensor::{Device, Tensor};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::time::Instant;
use tracing::trace_span;
use yoto_capture::skeleton::Skeleton;

/// Weight of the newest value in smoothed figures.
const SMOOTHING: f64 = 0.02;

/// A training under way.
pub struct Trainer {
    pub(super) config: ModelConfig,
    pub(super) options: TrainOptions,
    pub(super) subjects: Vec<TrainSubject>,
    /// Whose frame is next.
    pub(super) order: FrameOrder,
    pub(super) slots: Vec<Option<Skeleton>>,
    pub(super) joints: usize,
    pub(super) state: TrainState,
    pub(super) guard: Guard,
    pub(super) objective: Box<dyn Objective>,
    pub(super) patch_size: usize,
    pub(super) device: Device,
    /// Over the model's life.
    pub(super) step: u64,
    pub(super) seconds: f64,
    /// Share of a run that the model had been through before this one.
    pub(super) opened: f64,
    /// Within this budget.
    pub(super) budget_steps: u64,
    pub(super) budget_seconds: f64,
    pub(super) progress: TrainProgress,
}

impl Trainer {
    /// Share of a run that the model has been through, 0 to 1.
    pub(super) fn opened(&self) -> f64 {
        self.opened.max(self.fraction())
    }

    /// Share of the budget that is used, 0 to 1.
    pub(super) fn fraction(&self) -> f64 {
        let share = match self.options.budget {
            Budget::Seconds(seconds) => self.budget_seconds / seconds.max(f64::MIN_POSITIVE),
            Budget::Steps(steps) => self.budget_steps as f64 / steps.max(1) as f64,
        };
        share.min(1.0)
    }

    /// Whether the budget is used up.
    pub fn finished(&self) -> bool {
        self.fraction() >= 1.0
    }

    /// Takes one step.
    ///
    /// # Errors
    /// When the device fails, or training diverged for good.
    pub fn step(&mut self) -> Result<(), TrainError> {
        let start = Instant::now();
        let mut rng = step_stream(self.options.seed, self.step);
        let place = self.order.place(self.step);
        let subject = &self.subjects[place.subject];
        let frame = &subject.frames[place.frame];
        let batch = trace_span!("draw").in_scope(|| {
            patches::draw(
                frame,
                &subject.body,
                self.config.optimise.patches,
                self.patch_size,
                &mut rng,
            )
        });
        let scene = Scene {
            config: &self.config,
            body: &subject.body,
            slot: subject.slot,
            pose: &frame.pose,
            progress: self.opened(),
            step: self.step,
            occupancy: self.state.occupancy[subject.slot].as_ref(),
        };
        let slot = subject.slot;
        let outcome = outcome(
            self.state.avatar(),
            &scene,
            &batch,
            self.objective.as_ref(),
            Some(&mut rng),
        )?;
        // Without an outcome no ray meets the body: there is nothing to learn.
        let counts = outcome.as_ref().map(|o| o.counts).unwrap_or_default();
        self.progress.live_fraction = smoothed(
            self.progress.live_fraction,
            counts.live_fraction(),
            self.progress.step,
        );
        self.progress.samples += counts;
        if let Some(outcome) = outcome {
            let taken = self.descend(outcome.loss, &outcome.terms)?;
            if let (true, Some(seen), Some(grid)) =
                (taken, outcome.observations, &mut self.state.occupancy[slot])
            {
                grid.learn(&seen);
            }
        }
        self.step += 1;
        self.budget_steps += 1;
        let seconds = start.elapsed().as_secs_f64();
        self.seconds += seconds;
        self.budget_seconds += seconds;
        let rate = 1.0 / seconds.max(1e-6);
        self.progress.steps_per_second =
            smoothed(self.progress.steps_per_second, rate, self.progress.step);
        self.progress.step = self.step;
        Ok(())
    }

    /// Whether the step was taken.
    fn descend(&mut self, loss: Tensor<1>, terms: &[LossTerm]) -> Result<bool, TrainError> {
        // One reading for all: each is a wait for the device.
        let mut values = vec![loss.clone()];
        values.extend(terms.iter().map(|term| term.value.clone()));
        let values = read(Tensor::cat(values, 0))?;
        let (value, values) = values.split_first().ok_or(TrainError::NoLoss)?;
        let value = *value;
        let grads = trace_span!("backward")
            .in_scope(|| GradientsParams::from_grads(loss.backward(), self.state.avatar()));
        let rate = self.config.schedule.rate(self.fraction());
        let verdict = self
            .guard
            .step(&mut self.state, value, grads, rate, self.step);
        match verdict {
            Verdict::Taken => {
                let steps = self.progress.step;
                self.progress.loss = smoothed(self.progress.loss, f64::from(value), steps);
                self.progress
                    .note_terms(terms, values, |old, new| smoothed(old, new, steps));
            }
            Verdict::Skipped => tracing::warn!(
                step = self.step,
                "loss or gradients not finite: step skipped"
            ),
            Verdict::RolledBack => {
                tracing::warn!(step = self.step, "back to the last good state, rate halved")
            }
            Verdict::GivenUp => {
                return Err(TrainError::Diverged {
                    step: self.step,
                    rollbacks: self.guard.rollbacks,
                });
            }
        }
        Ok(verdict == Verdict::Taken)
    }
}

/// Draws of a step depend on the seed and its number alone, so that a resumed training draws
/// what an uninterrupted one would have.
fn step_stream(seed: u64, step: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(step);
    rng
}

fn smoothed(old: f64, new: f64, steps: u64) -> f64 {
    let weight = SMOOTHING.max(1.0 / (steps + 1) as f64);
    old + weight * (new - old)
}
