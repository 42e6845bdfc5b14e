//! The state of a training, and its steps.

use super::batch::{Scene, outcome};
use super::exposure::exposed;
use super::frame_order::{FrameIndex, FrameOrder, Practice};
use super::guard::{Guard, TrainState, Verdict};
use super::options::{Budget, TrainOptions};
use super::patches;
use super::people::TrainSubject;
use super::whole_picture::{compared, pictured};
use super::{Preview, TrainError, TrainProgress};
use crate::avatar::AvatarAppearance;
use crate::config::ModelConfig;
use crate::host::read;
use crate::loss::{LossTerm, Objective};
use crate::render::SampleCounts;
use burn::optim::GradientsParams;
use burn::tensor::{Device, Tensor};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeSet;
use std::time::Instant;
use tracing::trace_span;
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::Skeleton;

/// Weight of the newest value in smoothed figures.
const SMOOTHING: f64 = 0.02;

/// A training under way.
pub struct Trainer {
    pub(super) config: ModelConfig,
    pub(super) options: TrainOptions,
    pub(super) subjects: Vec<TrainSubject>,
    /// Order of the frames.
    pub(super) order: FrameOrder,
    pub(super) slots: Vec<Option<Skeleton>>,
    /// Slots whose people changed nothing but their own parameters.
    pub(super) own_only: BTreeSet<usize>,
    /// The steps with the person in each slot.
    pub(super) practice: Vec<Practice>,
    /// Slots of people who were removed.
    pub(super) erased: BTreeSet<usize>,
    /// Refined pose tracks of people who do not take part: their slots and files.
    pub(super) kept_tracks: Vec<(usize, Vec<u8>)>,
    pub(super) joints: usize,
    pub(super) state: TrainState,
    pub(super) guard: Guard,
    pub(super) objective: Box<dyn Objective>,
    pub(super) patch_size: usize,
    pub(super) device: Device,
    /// Steps over the model's life.
    pub(super) step: u64,
    /// Seconds spent in steps over the model's life.
    pub(super) seconds: f64,
    /// Completed fraction of a run before this one.
    pub(super) opened: f64,
    /// Whether this budget goes on with a model that was trained with the same people before.
    pub(super) goes_on: bool,
    /// Steps of this budget.
    pub(super) budget_steps: u64,
    /// Seconds of this budget spent in steps.
    pub(super) budget_seconds: f64,
    pub(super) progress: TrainProgress,
    /// Pictures of the last validation.
    pub(super) previews: Vec<Preview>,
}

impl Trainer {
    /// Completed fraction of a run over the model's life, 0 to 1; it never decreases.
    pub(super) fn opened(&self) -> f64 {
        match self.options.learn.only() {
            // More of the trunk would change everybody.
            Some(_) => self.opened,
            None => self.opened.max(self.fraction()),
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

    /// Where this step is in the schedule of rates, 0 to 1.
    fn place_in_rates(&self) -> f64 {
        let begins = match (self.goes_on, self.options.budget) {
            (false, _) => 0.0,
            (true, Budget::Seconds(run)) => {
                let before = self.seconds - self.budget_seconds;
                self.config.schedule.begins_at(before, run)
            }
            (true, Budget::Steps(run)) => {
                let before = self.step.saturating_sub(self.budget_steps);
                self.config.schedule.begins_at(before as f64, run as f64)
            }
        };
        begins + (1.0 - begins) * self.fraction()
    }

    /// Whether the budget is used up.
    pub fn finished(&self) -> bool {
        self.fraction() >= 1.0
    }

    /// Takes one step.
    ///
    /// # Errors
    /// If the device fails, or training diverged.
    pub fn step(&mut self) -> Result<(), TrainError> {
        let start = Instant::now();
        let mut rng = step_stream(self.options.seed, self.step);
        let place = self.next_place();
        self.fit_pose(place, &mut rng)?;
        self.place_again(place)?;
        let pose = self.pose(place);
        match self.state.avatar().appearance(&self.config) {
            AvatarAppearance::Splats(splats) => {
                let frame = &self.subjects[place.subject].frames[place.frame];
                let picture = pictured(splats, &self.scene(place, &pose), &frame.camera);
                self.learn_from_picture(place, picture)?;
            }
            AvatarAppearance::Field(_) => self.learn_from_patches(place, &pose, &mut rng)?,
        }
        self.practice[self.subjects[place.subject].slot].steps += 1;
        self.step += 1;
        self.budget_steps += 1;
        let seconds = start.elapsed().as_secs_f64();
        self.seconds += seconds;
        self.budget_seconds += seconds;
        let rate = 1.0 / seconds.max(1e-6);
        self.progress.steps_per_second =
            smoothed(self.progress.steps_per_second, rate, self.progress.step);
        self.progress.step = self.step;
        if self.finished() {
            self.guess_unseen()?;
        }
        Ok(())
    }

    /// The frame of the next step.
    fn next_place(&mut self) -> FrameIndex {
        let slots = self.subjects.iter().map(|it| it.slot);
        let practice: Vec<Practice> = slots.map(|slot| self.practice[slot]).collect();
        self.order.at(self.step, &practice)
    }

    /// The frame at `place` in `pose`, and the state of the model.
    fn scene<'a>(&'a self, place: FrameIndex, pose: &'a Pose) -> Scene<'a> {
        let subject = &self.subjects[place.subject];
        Scene {
            config: &self.config,
            body: &subject.body,
            slot: subject.slot,
            pose,
            progress: self.opened(),
            step: self.step,
            occupancy: self.state.occupancy[subject.slot].as_ref(),
        }
    }

    /// Learns from the whole frame at `place`, of which the model has the `picture` `[H W, 4]`.
    fn learn_from_picture(
        &mut self,
        place: FrameIndex,
        picture: Tensor<2>,
    ) -> Result<(), TrainError> {
        let frame = &self.subjects[place.subject].frames[place.frame];
        let image = self.subjects[place.subject].image(frame);
        let exposure = self.fit_exposure(place, &image, &picture)?;
        let (loss, terms) = compared(exposed(picture, &exposure), &image, &self.config);
        self.descend(scaled(loss, self.weight(place)), &terms)?;
        Ok(())
    }

    /// Learns from patches of the frame at `place`, ray by ray.
    fn learn_from_patches(
        &mut self,
        place: FrameIndex,
        pose: &Pose,
        rng: &mut ChaCha8Rng,
    ) -> Result<(), TrainError> {
        let subject = &self.subjects[place.subject];
        let frame = &subject.frames[place.frame];
        let batch = trace_span!("draw").in_scope(|| {
            patches::draw(
                &subject.picture(frame),
                &frame.camera,
                pose,
                &subject.body,
                self.config.optimise.patches,
                self.patch_size,
                rng,
            )
        });
        let scene = self.scene(place, pose);
        let slot = subject.slot;
        let outcome = outcome(
            self.state.avatar(),
            &scene,
            &batch,
            self.objective.as_ref(),
            Some(rng),
        )?;
        // Without an outcome, no sample was evaluated and there is nothing to learn.
        let counts = outcome
            .as_ref()
            .map_or(SampleCounts::default(), |outcome| outcome.counts);
        self.progress.live_fraction = smoothed(
            self.progress.live_fraction,
            counts.live_fraction(),
            self.progress.step,
        );
        self.progress.samples += counts;
        let Some(outcome) = outcome else {
            return Ok(());
        };
        let loss = scaled(outcome.loss, self.weight(place));
        let taken = self.descend(loss, &outcome.terms)?;
        if let (true, Some(seen), Some(grid)) =
            (taken, outcome.observations, &mut self.state.occupancy[slot])
        {
            grid.learn(&seen);
        }
        Ok(())
    }

    /// Updates the model, and returns whether the step was taken.
    fn descend(&mut self, loss: Tensor<1>, terms: &[LossTerm]) -> Result<bool, TrainError> {
        // Read together, since each read waits for the device.
        let mut values = vec![loss.clone()];
        values.extend(terms.iter().map(|term| term.value.clone()));
        let values = read(Tensor::cat(values, 0))?;
        let (value, values) = values.split_first().ok_or(TrainError::NoLoss)?;
        let value = *value;
        let grads = trace_span!("backward")
            .in_scope(|| GradientsParams::from_grads(loss.backward(), self.state.avatar()));
        let rate = self.config.schedule.rate(self.place_in_rates());
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
                "loss or gradients are not finite: step skipped"
            ),
            Verdict::RolledBack => {
                tracing::warn!(
                    step = self.step,
                    "returned to the last good state with half the learning rate"
                )
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

/// `loss` times `weight`.
fn scaled(loss: Tensor<1>, weight: f64) -> Tensor<1> {
    match weight < 1.0 {
        true => loss * weight,
        false => loss,
    }
}

/// The random generator of a step. It depends only on the seed and the number of the step, so that
/// a resumed training draws the same numbers as an uninterrupted one.
fn step_stream(seed: u64, step: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(step);
    rng
}

/// Exponential moving average of a figure after `steps` steps.
fn smoothed(old: f64, new: f64, steps: u64) -> f64 {
    let weight = SMOOTHING.max(1.0 / (steps + 1) as f64);
    old + weight * (new - old)
}
