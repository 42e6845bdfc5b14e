//! Steps of a training.

use crate::avatar::AvatarAppearance;
use crate::loss::LossTerm;
use crate::pool::in_pool;
use crate::render::SampleCounts;
use crate::render::occupancy::DensityObservations;
use crate::train::TrainError;
use crate::train::data::Data;
use crate::train::exposure::{apply_exposure, fit_exposure};
use crate::train::frames::batch::outcome;
use crate::train::frames::order::FrameIndex;
use crate::train::frames::patches;
use crate::train::frames::whole_picture::{frame_loss, render_frame};
use crate::train::known::Known;
use crate::train::model::Model;
use crate::train::poses::fit::{fit_pose, pose};
use crate::train::run::best::Best;
use crate::train::run::{Moment, Run};
use crate::train::splats::placing::split_splats;
use crate::train::splats::unseen::{guess_unseen, update_frozen_colours};
use burn::tensor::Tensor;
use rand_chacha::ChaCha8Rng;
use std::time::Instant;
use tracing::trace_span;
use yoto_capture::camera::Pose;

/// A training under way.
pub struct Trainer {
    pub(super) run: Run,
    pub(super) data: Data,
    pub(super) model: Model,
    pub(super) known: Known,
    /// The best state that a validation has measured; none of models with a field, whose parts take part by the
    /// progress of the run.
    pub(super) best: Option<Best>,
}

/// The loss of a step.
struct StepLoss {
    /// `[1]`: the weighted sum of the terms.
    loss: Tensor<1>,
    terms: Vec<LossTerm>,
    /// Densities for the person's occupancy grid.
    observations: Option<DensityObservations>,
}

impl Trainer {
    /// Whether the budget is used up.
    pub fn finished(&self) -> bool {
        self.run.is_over()
    }

    /// Takes one step.
    ///
    /// # Errors
    /// If the device fails, or training diverged.
    pub fn step(&mut self) -> Result<(), TrainError> {
        in_pool(|| self.step_in_pool())
    }

    fn step_in_pool(&mut self) -> Result<(), TrainError> {
        let start = Instant::now();
        let now = self.run.moment();
        let mut rng = self.run.stream();
        let index = self.data.at(now.step, &self.known);
        let (subject, frame) = self.data.frame(index);
        let slot = subject.slot;
        // What comes before learning, in this order: each knows when it is due, by what those before it have changed.
        fit_pose(&mut self.model, subject, frame, now, &mut rng)?;
        split_splats(&mut self.model, subject, now)?;
        let (subjects, options) = (self.data.subjects(), self.run.options());
        update_frozen_colours(&mut self.model, subjects, options, now)?;
        let pose = pose(&self.model.state, subject, frame);
        let weight = self.model.state.weight(slot, frame);
        let learned = match self.model.appearance() {
            AvatarAppearance::Splats(splats) => {
                let scene = self.model.scene(subject, &pose, now);
                let picture = render_frame(splats, &scene, &frame.camera)?;
                Some(self.learn_from_picture(index, now, picture)?)
            }
            AvatarAppearance::Field(_) => self.learn_from_patches(index, now, &pose, &mut rng)?,
        };
        // Without a loss, no sample was evaluated and there is nothing to learn.
        if let Some(StepLoss {
            loss,
            terms,
            observations,
        }) = learned
        {
            let rate = self.run.rate(&self.model.config.schedule);
            let loss = scaled(loss, weight);
            let descent = self.model.descend(loss, &terms, rate, now.step)?;
            if descent.taken {
                self.run.note_loss(descent.loss, &terms, &descent.terms);
                let grid = &mut self.model.state.occupancy[slot];
                if let (Some(observations), Some(grid)) = (observations, grid) {
                    grid.learn(&observations);
                }
            }
        }
        self.known.count_step(slot);
        self.run.count_step(start.elapsed().as_secs_f64());
        if self.run.is_over() {
            let notes = self.guess_unseen()?;
            self.run.note(notes);
        }
        Ok(())
    }

    /// Guesses what no frame shows, unless that is not wanted. Returns notes for people.
    pub(super) fn guess_unseen(&mut self) -> Result<Vec<String>, TrainError> {
        if self.run.options().leave_unseen {
            return Ok(Vec::new());
        }
        let schedule_progress = self.run.schedule_progress();
        let prior = self.run.options().prior.decoder();
        guess_unseen(
            &mut self.model,
            self.data.subjects(),
            prior,
            schedule_progress,
        )
    }

    /// The loss of a whole frame, of which the model has the `picture` `[H W, 4]`.
    fn learn_from_picture(
        &mut self,
        index: FrameIndex,
        now: Moment,
        picture: Tensor<2>,
    ) -> Result<StepLoss, TrainError> {
        let (subject, frame) = self.data.frame(index);
        let image = subject.image(frame);
        let fitted = fit_exposure(
            &mut self.model,
            subject,
            frame,
            now.schedule_progress,
            &image,
            &picture,
        )?;
        self.run.note(fitted.note);
        let picture = apply_exposure(picture, &fitted.exposure);
        let (loss, terms) = frame_loss(picture, &image, &self.model.config);
        Ok(StepLoss {
            loss,
            terms,
            observations: None,
        })
    }

    /// The loss of patches of a frame, ray by ray; `None` if no ray meets anything.
    fn learn_from_patches(
        &mut self,
        index: FrameIndex,
        now: Moment,
        pose: &Pose,
        rng: &mut ChaCha8Rng,
    ) -> Result<Option<StepLoss>, TrainError> {
        let (subject, frame) = self.data.frame(index);
        let learning = self.model.patches().ok_or(TrainError::NoLoss)?;
        let batch = trace_span!("draw").in_scope(|| {
            patches::draw(
                &subject.picture(frame),
                &frame.camera,
                pose,
                &subject.body,
                self.model.config.optimise.patches,
                learning.size,
                rng,
            )
        });
        let outcome = outcome(
            self.model.state.avatar(),
            &self.model.scene(subject, pose, now),
            &batch,
            learning.objective.as_ref(),
            Some(rng),
        )?;
        let counts = outcome.as_ref().map(|outcome| outcome.counts);
        self.run
            .note_samples(counts.unwrap_or_else(SampleCounts::default));
        Ok(outcome.map(|outcome| StepLoss {
            loss: outcome.loss,
            terms: outcome.terms,
            observations: outcome.observations,
        }))
    }
}

/// `loss` times `weight`.
fn scaled(loss: Tensor<1>, weight: f64) -> Tensor<1> {
    match weight < 1.0 {
        true => loss * weight,
        false => loss,
    }
}
