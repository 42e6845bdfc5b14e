//! A model in training: its configuration, its state, and how it learns.

use crate::avatar::AvatarAppearance;
use crate::config::ModelConfig;
use crate::host::read;
use crate::loss::{LossTerm, Objective};
use crate::train::TrainError;
use crate::train::frames::batch::Scene;
use crate::train::people::TrainSubject;
use crate::train::run::Moment;
use crate::train::run::checkpoint::ModelState;
use crate::train::run::guard::{Guard, TrainState, Verdict};
use burn::optim::GradientsParams;
use burn::tensor::{Device, Tensor};
use tracing::trace_span;
use yoto_capture::camera::Pose;

/// A model in training.
pub(crate) struct Model {
    pub config: ModelConfig,
    /// Number of joints of each skeleton.
    pub joints: usize,
    /// A device that differentiates.
    pub device: Device,
    pub state: TrainState,
    guard: Guard,
    /// How it compares patches; `None` for splats, which learn from whole pictures.
    patches: Option<PatchLearning>,
}

/// Settings by which a model learns from patches.
pub(crate) struct PatchLearning {
    pub objective: Box<dyn Objective>,
    /// Side length of a patch, pixels.
    pub size: usize,
}

/// A step down the gradients of a loss.
pub(crate) struct Descent {
    /// Value of the loss.
    pub loss: f32,
    /// Values of its terms.
    pub terms: Vec<f32>,
    /// Whether the step was taken.
    pub taken: bool,
}

impl Model {
    /// The model of `saved` in `state`.
    pub(super) fn new(
        saved: &ModelState,
        state: TrainState,
        device: Device,
        patches: Option<PatchLearning>,
    ) -> Self {
        Self {
            config: saved.config.clone(),
            joints: saved.joints,
            device,
            state,
            guard: Guard::new(saved.skipped_steps, saved.rollbacks),
            patches,
        }
    }

    /// The model's representation in canonical space.
    pub(super) fn appearance(&self) -> AvatarAppearance<'_> {
        self.state.avatar().appearance(&self.config)
    }

    /// How the model compares patches; `None` for splats.
    pub(super) fn patches(&self) -> Option<&PatchLearning> {
        self.patches.as_ref()
    }

    /// Replaces the objective.
    ///
    /// # Errors
    /// If the model learns from whole pictures.
    pub(super) fn set_objective(
        &mut self,
        objective: Box<dyn Objective>,
    ) -> Result<(), TrainError> {
        match &mut self.patches {
            Some(patches) => patches.objective = objective,
            None => {
                return Err(TrainError::Objective {
                    objective: objective.name(),
                    tier: self.config.tier.clone(),
                });
            }
        }
        Ok(())
    }

    /// The person in `pose`, and the state of the model.
    pub(super) fn scene<'a>(
        &'a self,
        subject: &'a TrainSubject,
        pose: &'a Pose,
        now: Moment,
    ) -> Scene<'a> {
        Scene {
            config: &self.config,
            body: &subject.body,
            slot: subject.slot,
            pose,
            schedule_progress: now.schedule_progress,
            step: now.step,
            occupancy: self.state.occupancy[subject.slot].as_ref(),
        }
    }

    /// Steps down the gradients of `loss`, whose `terms` are only read, at the learning rates times `rate`.
    ///
    /// # Errors
    /// If the device fails, or training diverged.
    pub(super) fn descend(
        &mut self,
        loss: Tensor<1>,
        terms: &[LossTerm],
        rate: f64,
        step: u64,
    ) -> Result<Descent, TrainError> {
        // Read together, since each read waits for the device.
        let mut values = vec![loss.clone()];
        values.extend(terms.iter().map(|term| term.value.clone()));
        let values = read(Tensor::cat(values, 0))?;
        let (value, values) = values.split_first().ok_or(TrainError::NoLoss)?;
        let grads = trace_span!("backward")
            .in_scope(|| GradientsParams::from_grads(loss.backward(), self.state.avatar()));
        let verdict = self.guard.step(&mut self.state, *value, grads, rate, step);
        match verdict {
            Verdict::Taken => {}
            Verdict::Skipped => {
                tracing::warn!(step, "loss or gradients are not finite: step skipped");
            }
            Verdict::RolledBack => {
                tracing::warn!(
                    step,
                    "returned to the last good state with half the learning rate"
                );
            }
            Verdict::GivenUp => {
                return Err(TrainError::Diverged {
                    step,
                    rollbacks: self.guard.rollbacks,
                });
            }
        }
        Ok(Descent {
            loss: *value,
            terms: values.to_vec(),
            taken: verdict == Verdict::Taken,
        })
    }

    /// Steps that were skipped, and returns to an earlier state.
    pub(super) fn mishaps(&self) -> (u64, u64) {
        (self.guard.skipped, self.guard.rollbacks)
    }

    /// Parts that take part only from some moment of a run on, and do after the fraction `schedule_progress`.
    pub(super) fn active_parts(&self, schedule_progress: f64) -> Vec<String> {
        let config = &self.config;
        let mut parts = config
            .schedule
            .active_parts(schedule_progress, config.non_rigid.bands);
        if config.active_pose_shapes(schedule_progress).is_some() {
            parts.push("pose blend shapes".to_owned());
        }
        let refined = self.state.poses.iter().any(Option::is_some);
        if refined && config.refinement.takes_part(schedule_progress) {
            parts.push("pose refinement".to_owned());
        }
        parts
    }

    /// Writes what a checkpoint's state keeps of the model into `state`.
    pub(super) fn record(&self, state: &mut ModelState) {
        state.rate_scale = self.state.rate_scale;
        (state.skipped_steps, state.rollbacks) = self.mishaps();
    }
}
