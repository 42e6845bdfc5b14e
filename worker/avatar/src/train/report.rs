//! Results of a training: its progress, its checkpoint, and the model for rendering.

use super::checkpoint::{self, ModelState};
use super::exposure;
use super::options::{Budget, Validation};
use super::refinement_file;
use super::trainer::Trainer;
use super::{TrainError, TrainProgress};
use crate::avatar::Avatar;
use crate::motion::body::Body;
use crate::render::Renderer;
use burn::module::Module;
use std::path::Path;
use yoto_capture::skeleton::Skeleton;

impl Trainer {
    /// Slots of the people whom the model knows: those of this training and of earlier ones.
    pub fn known_slots(&self) -> impl Iterator<Item = usize> {
        let slots = self.slots.iter().enumerate();
        slots.filter_map(|(slot, skeleton)| skeleton.as_ref().map(|_| slot))
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
            active_parts: self.active_parts(),
            ..self.progress.clone()
        }
    }

    /// Whose poses are refined and why, and what became of single frames, for people.
    pub fn notes(&self) -> Vec<String> {
        let all = Validation::NONE == self.options.validation;
        let unmeasured = self
            .subjects
            .iter()
            .filter(|it| !all && it.held_out.is_empty());
        let unmeasured = unmeasured.map(|it| {
            format!(
                "{}: too few frames to hold one out, so that nothing measures this person",
                it.name
            )
        });
        [
            self.progress.notes.clone(),
            self.doubts(),
            unmeasured.collect(),
        ]
        .concat()
    }

    /// Parts that take part only from some moment of a run on, and do now.
    fn active_parts(&self) -> Vec<String> {
        let (config, progress) = (&self.config, self.opened());
        let bands = config.non_rigid.bands;
        let mut parts = config.schedule.active_parts(progress, bands);
        let refined = self.state.poses.iter().any(Option::is_some);
        if refined && config.refinement.takes_part(progress) {
            parts.push("pose refinement".to_owned());
        }
        parts
    }

    /// Writes a checkpoint into `dir`.
    ///
    /// # Errors
    /// If a file can't be written.
    pub fn save(&self, dir: &Path) -> Result<(), TrainError> {
        let state = ModelState {
            step: self.step,
            progress: self.opened(),
            train_seconds: self.seconds,
            rate_scale: self.state.rate_scale,
            skipped_steps: self.guard.skipped,
            rollbacks: self.guard.rollbacks,
            goes_on: self.goes_on,
            own_only: self.own_only.clone(),
            practice: self.practice.clone(),
            erased: self.erased.clone(),
            ..ModelState::new(
                self.config.clone(),
                self.joints,
                self.options.seed,
                self.slots.clone(),
            )
        };
        checkpoint::save_occupancy(dir, &self.state.occupancy)?;
        refinement_file::save(dir, &self.state.poses)?;
        exposure::file::save(dir, &self.state.exposures)?;
        for (slot, file) in &self.kept_tracks {
            refinement_file::keep(dir, *slot, file)?;
        }
        for subject in &self.subjects {
            if let Some(track) = self.refined_track(subject)? {
                refinement_file::save_track(dir, subject.slot, &track)?;
            }
        }
        checkpoint::save(dir, &state, self.state.avatar(), &self.state.optimiser)
    }

    /// The current model, for rendering.
    pub fn renderer(&self) -> Renderer {
        let device = self.device.clone().inner();
        let body = |slot: &Option<Skeleton>| {
            slot.clone()
                .map(|skeleton| Body::new(skeleton, &self.config, &device))
        };
        let bodies = self.slots.iter().map(body).collect();
        Renderer::new(
            self.config.clone(),
            self.state.avatar().valid(),
            bodies,
            self.state.occupancy.clone(),
            self.opened(),
        )
        .without(self.erased.clone())
    }

    /// Number of parameters that an additional person would add.
    pub fn parameters_of_a_person(&self) -> u64 {
        Avatar::parameters_of_a_person(&self.config, self.joints)
    }

    /// Number of parameters.
    pub fn parameters(&self) -> u64 {
        self.state.avatar().num_params() as u64
    }
}
