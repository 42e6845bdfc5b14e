//! The training loop's state: one call, one step.

use super::batch::{Scene, outcome};
use super::checkpoint::{self, State};
use super::guard::{Course, Guard, Verdict};
use super::optimiser::optimiser;
use super::options::{Budget, TrainOptions};
use super::patches;
use super::people::{Person, Trainee, check_people};
use super::{TrainError, TrainProgress};
use crate::avatar::Avatar;
use crate::config::{ConfigError, ModelConfig, Numerics};
use crate::loss::Objective;
use crate::motion::body::Body;
use crate::ops::mlp::check_device;
use crate::render::Renderer;
use crate::render::frame::read;
use crate::render::occupancy::Occupancy;
use burn::module::Module;
use burn::optim::GradientsParams;
use burn::tensor::{Device, Tensor};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::Path;
use std::time::Instant;
use tracing::trace_span;
use yoto_capture::skeleton::Skeleton;

/// Weight of the newest value in smoothed figures.
const SMOOTHING: f64 = 0.02;

/// A training under way.
pub struct Trainer {
    config: ModelConfig,
    options: TrainOptions,
    pub(super) trainees: Vec<Trainee>,
    slots: Vec<Option<Skeleton>>,
    joints: usize,
    course: Course,
    guard: Guard,
    objective: Objective,
    patch_size: usize,
    device: Device,
    /// Over the model's life.
    step: u64,
    seconds: f64,
    /// Share of a run that the model had been through before this one.
    opened: f64,
    /// Within this budget.
    budget_steps: u64,
    budget_seconds: f64,
    pub(super) progress: TrainProgress,
}

impl Trainer {
    /// Starts a model for `people` on `device`.
    ///
    /// # Errors
    /// When the people don't fit one model.
    pub fn new(
        config: ModelConfig,
        options: TrainOptions,
        people: Vec<Person>,
        device: &Device,
    ) -> Result<Self, TrainError> {
        config.check()?;
        let (slots, joints) = check_people(&people)?;
        let device = device.clone().inner().autodiff();
        let avatar = Avatar::new(&config, slots, joints, options.seed, &device);
        let state = State::new(config.clone(), joints, options.seed, vec![None; slots]);
        let course = Course::new(avatar, optimiser(&config.optimise));
        Self::assemble(state, options, &people, course, device)
    }

    /// Goes on with what [`Self::save`] wrote into `dir`. The seed is the checkpoint's. People in
    /// slots that the checkpoint has not start with fresh codes, tables and residuals.
    ///
    /// # Errors
    /// When the files are missing or torn, or the people don't fit the model.
    pub fn resume(
        dir: &Path,
        options: TrainOptions,
        people: Vec<Person>,
        device: &Device,
    ) -> Result<Self, TrainError> {
        let state = State::read(dir)?;
        let (slots, joints) = check_people(&people)?;
        if joints != state.joints {
            return Err(TrainError::People(format!(
                "the checkpoint's skeletons have {} joints, the people's have {joints}",
                state.joints
            )));
        }
        let device = device.clone().inner().autodiff();
        let mut course = Course::new(
            checkpoint::load_avatar(dir, &state, slots, &device)?,
            checkpoint::load_optimiser(dir, optimiser(&state.config.optimise))?,
        );
        course.occupancy = checkpoint::load_occupancy(dir, &state)?;
        course.rate_scale = state.rate_scale;
        Self::assemble(state, options, &people, course, device)
    }

    fn assemble(
        state: State,
        options: TrainOptions,
        people: &[Person],
        mut course: Course,
        device: Device,
    ) -> Result<Self, TrainError> {
        check_device(state.config.precision, &device)?;
        if state.config.numerics == Numerics::Reference {
            return Err(TrainError::Config(ConfigError::Field {
                field: "numerics",
                message: "a model trains with sound numerics; reference ones only render".into(),
            }));
        }
        let mut slots = state.slots;
        let needed = people
            .iter()
            .map(|person| person.slot + 1)
            .max()
            .unwrap_or(0);
        slots.resize(slots.len().max(needed), None);
        course.occupancy.resize(slots.len(), None);
        let mut trainees = Vec::with_capacity(people.len());
        for person in people {
            let trainee = Trainee::new(
                person,
                &state.config,
                options.image_size,
                options.holdout_every,
                &device,
            )?;
            let known = course.occupancy[person.slot].take();
            course.occupancy[person.slot] = Occupancy::new(&trainee.body.grid, &state.config.march)
                .map(|grid| grid.taught_by(known.as_ref()));
            slots[person.slot] = Some(trainee.body.skeleton.clone());
            trainees.push(trainee);
        }
        let smallest = trainees
            .iter()
            .flat_map(|t| &t.frames)
            .map(|f| f.image.width.min(f.image.height))
            .min();
        let patch_size = (state.config.optimise.patch_size as usize).min(smallest.unwrap_or(1));
        let objective =
            Objective::from_environment(state.config.optimise.ssim_weight, patch_size, &device)?;
        let progress = TrainProgress {
            objective: objective.name(),
            ..TrainProgress::default()
        };
        Ok(Self {
            config: state.config,
            options: TrainOptions {
                seed: state.seed,
                ..options
            },
            trainees,
            slots,
            joints: state.joints,
            course,
            guard: Guard::new(state.skipped_steps, state.rollbacks),
            objective,
            patch_size,
            device,
            step: state.step,
            seconds: state.train_seconds,
            opened: state.progress,
            budget_steps: options.used_steps,
            budget_seconds: options.used_seconds,
            progress,
        })
    }

    /// Share of a run that the model has been through, 0 to 1.
    fn opened(&self) -> f64 {
        self.opened.max(self.fraction())
    }

    /// Share of the budget that is used, 0 to 1.
    fn fraction(&self) -> f64 {
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
        // One random frame of a random identity, uniform over frames as in the paper.
        let total: usize = self.trainees.iter().map(|t| t.frames.len()).sum();
        let mut pick = rng.random_range(0..total);
        let mut chosen = &self.trainees[0];
        for trainee in &self.trainees {
            chosen = trainee;
            if pick < trainee.frames.len() {
                break;
            }
            pick -= trainee.frames.len();
        }
        let frame = &chosen.frames[pick];
        let batch = trace_span!("draw").in_scope(|| {
            patches::draw(
                frame,
                &chosen.body,
                self.config.optimise.patches,
                self.patch_size,
                &mut rng,
            )
        });
        let scene = Scene {
            config: &self.config,
            body: &chosen.body,
            slot: chosen.slot,
            pose: &frame.pose,
            progress: self.opened(),
            step: self.step,
            occupancy: self.course.occupancy[chosen.slot].as_ref(),
        };
        let slot = chosen.slot;
        let outcome = outcome(
            self.course.avatar(),
            &scene,
            &batch,
            &self.objective,
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
            let taken = self.descend(outcome.loss)?;
            if let (true, Some(met), Some(grid)) =
                (taken, outcome.met, &mut self.course.occupancy[slot])
            {
                grid.learn(&met.points, &met.densities, &met.likelihoods);
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
    fn descend(&mut self, loss: Tensor<1>) -> Result<bool, TrainError> {
        let value = read(loss.clone())?.first().copied().unwrap_or(f32::NAN);
        let grads = trace_span!("backward")
            .in_scope(|| GradientsParams::from_grads(loss.backward(), self.course.avatar()));
        let rate = self.config.schedule.rate(self.fraction());
        let verdict = self
            .guard
            .step(&mut self.course, value, grads, rate, self.step);
        match verdict {
            Verdict::Taken => {
                self.progress.loss =
                    smoothed(self.progress.loss, f64::from(value), self.progress.step)
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

    /// Current progress.
    pub fn progress(&self) -> TrainProgress {
        let fraction = self.fraction();
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
            fraction,
            seconds_left,
            skipped_steps: self.guard.skipped,
            rollbacks: self.guard.rollbacks,
            train_seconds: self.budget_seconds,
            active_parts: self
                .config
                .schedule
                .active_parts(self.opened(), self.config.non_rigid.bands),
            ..self.progress.clone()
        }
    }

    /// Writes weights, optimiser and state into `dir`.
    ///
    /// # Errors
    /// When a file can't be written.
    pub fn save(&self, dir: &Path) -> Result<(), TrainError> {
        let state = State {
            step: self.step,
            progress: self.opened(),
            train_seconds: self.seconds,
            rate_scale: self.course.rate_scale,
            skipped_steps: self.guard.skipped,
            rollbacks: self.guard.rollbacks,
            ..State::new(
                self.config.clone(),
                self.joints,
                self.options.seed,
                self.slots.clone(),
            )
        };
        checkpoint::save_occupancy(dir, &self.course.occupancy)?;
        checkpoint::save(dir, &state, self.course.avatar(), &self.course.optimiser)
    }

    /// The model as it stands, for rendering.
    pub fn renderer(&self) -> Renderer {
        let device = self.device.clone().inner();
        let body = |slot: &Option<Skeleton>| {
            slot.clone()
                .map(|skeleton| Body::new(skeleton, &self.config, &device))
        };
        let bodies = self.slots.iter().map(body).collect();
        Renderer::new(
            self.config.clone(),
            self.course.avatar().valid(),
            bodies,
            self.course.occupancy.clone(),
            self.opened(),
        )
    }

    /// Numbers that a further person would add.
    pub fn parameters_of_a_person(&self) -> u64 {
        Avatar::parameters_of_a_person(&self.config, self.joints)
    }

    /// Numbers that are learned.
    pub fn parameters(&self) -> u64 {
        self.course.avatar().num_params() as u64
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
