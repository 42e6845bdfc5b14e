//! Results of a training: its progress, its checkpoint, and the model for rendering.

use crate::avatar::Avatar;
use crate::motion::body::CanonicalBody;
use crate::render::{FrameExposure, Renderer};
use crate::train::poses::fit::{fitted_pose, refined_track};
use crate::train::poses::refinement_file;
use crate::train::poses::wrong_frames::doubts;
use crate::train::run::best::Best;
use crate::train::run::checkpoint::{self, ModelState};
use crate::train::run::options::Validation;
use crate::train::run::validate::validate;
use crate::train::trainer::Trainer;
use crate::train::{Preview, TrainError, TrainProgress, exposure};
use burn::module::Module;
use std::path::Path;
use yoto_capture::FrameImage;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;

impl Trainer {
    /// Slots of the people whom the model knows: those of this training and of earlier ones.
    pub fn known_slots(&self) -> impl Iterator<Item = usize> {
        let slots = self.known.skeletons().iter().enumerate();
        slots.filter_map(|(slot, skeleton)| skeleton.as_ref().map(|_| slot))
    }

    /// Current progress.
    pub fn progress(&self) -> TrainProgress {
        let (skipped_steps, rollbacks) = self.model.mishaps();
        TrainProgress {
            skipped_steps,
            rollbacks,
            active_parts: self.model.active_parts(self.run.schedule_progress()),
            ..self.run.progress()
        }
    }

    /// The people whose poses are refined and why, and what became of single frames, for people.
    pub fn notes(&self) -> Vec<String> {
        let all = Validation::NONE == self.run.options().validation;
        let subjects = self.data.subjects();
        let unmeasured = subjects.iter().filter(|it| !all && it.held_out.is_empty());
        let unmeasured = unmeasured.map(|it| {
            format!(
                "{}: too few frames to hold one out, so that nothing measures this person",
                it.name
            )
        });
        [
            self.run.notes().to_vec(),
            doubts(&self.model, subjects),
            unmeasured.collect(),
        ]
        .concat()
    }

    /// The first held-out frame of each person that has one, as the last [validation] rendered it;
    /// none before the first validation.
    ///
    /// [validation]: Self::validate
    pub fn previews(&self) -> &[Preview] {
        self.run.previews()
    }

    /// Renders held-out frames and sets PSNR and SSIM of the progress to their means. Where poses
    /// are refined, those of held-out frames change as their neighbours' do, without a look at their
    /// pictures; their exposures lie between those of their neighbours. Training time does not include this.
    ///
    /// # Errors
    /// If the device fails.
    pub fn validate(&mut self) -> Result<(), TrainError> {
        self.validate_with(&mut || {})
    }

    /// As [`Self::validate`]; `on_batch` is called before each batch of rays, since a frame of the paper's tiers takes
    /// most of a minute.
    ///
    /// # Errors
    /// If the device fails.
    pub fn validate_with(&mut self, on_batch: &mut dyn FnMut()) -> Result<(), TrainError> {
        let (renderer, schedule_progress) = (self.renderer(), self.run.schedule_progress());
        let subjects = self.data.subjects();
        let measured = validate(
            &renderer,
            &self.model,
            subjects,
            schedule_progress,
            on_batch,
        )?;
        self.run.take_measured(measured);
        let progress = self.run.progress();
        let restorable = self.model.config.appearance.capabilities().restorable;
        if let Some(psnr) = progress.psnr.filter(|_| restorable) {
            let known = self.best.take();
            self.best = Best::of(known, &self.model.state, psnr, progress.step);
        }
        Ok(())
    }

    /// Returns to the state that measured best on held-out frames, if the last one that was measured is clearly
    /// worse, and measures again; only in models whose states are restorable. A process
    /// that resumes a run knows the states that it measured itself.
    ///
    /// # Errors
    /// If the device fails.
    pub fn keep_best(&mut self, on_batch: &mut dyn FnMut()) -> Result<(), TrainError> {
        let (Some(best), Some(psnr)) = (&self.best, self.run.progress().psnr) else {
            return Ok(());
        };
        if let Some(note) = best.return_to(&mut self.model.state, psnr) {
            tracing::info!("{note}");
            self.run.note(Some(note));
            self.guess_unseen()?;
            self.validate_with(on_batch)?;
        }
        Ok(())
    }

    /// `pose` of the person in `slot` after a fit to the picture `image` by `camera`, with the
    /// model as it is. Every picture gets the same number of steps.
    ///
    /// # Errors
    /// If training has nobody in `slot`, or the device fails.
    pub fn fitted_pose(
        &self,
        slot: usize,
        pose: &Pose,
        camera: &Camera,
        image: &FrameImage,
    ) -> Result<Pose, TrainError> {
        let subject = self.data.in_slot(slot);
        let subject =
            subject.ok_or_else(|| TrainError::People(format!("nobody in slot {slot}")))?;
        let at = (self.run.schedule_progress(), self.run.options().seed);
        fitted_pose(&self.model, subject, pose, camera, image, at)
    }

    /// The pose of each training frame of the person in `slot` as training has refined it, with the
    /// frame's index in the pose track; empty where poses stay as they are given.
    pub fn refined_poses(&self, slot: usize) -> Vec<(usize, Pose)> {
        let poses = self.model.state.poses.get(slot).and_then(Option::as_ref);
        let (Some(subject), Some(poses)) = (self.data.in_slot(slot), poses) else {
            return Vec::new();
        };
        let frames = subject.frames.iter();
        frames
            .map(|frame| (frame.position, poses.refined(frame.position, &frame.pose)))
            .collect()
    }

    /// The given `pose` of a frame of the same film with this `index`, which the training does not have, changed as the
    /// nearest training frames before and after it are; as it is where poses stay as they are given.
    pub fn pose_near(&self, slot: usize, index: u32, pose: &Pose) -> Pose {
        let poses = self.model.state.poses.get(slot).and_then(Option::as_ref);
        let (Some(subject), Some(poses)) = (self.data.in_slot(slot), poses) else {
            return pose.clone();
        };
        let frames = &subject.track.frames;
        let after = frames.partition_point(|frame| frame.index < index);
        let last = frames.len() - 1;
        let positions = [after.saturating_sub(1), after.min(last)];
        let [from, to] = positions.map(|position| f64::from(frames[position].index));
        let at = if to > from {
            ((f64::from(index) - from) / (to - from)).clamp(0.0, 1.0)
        } else {
            0.0
        };
        poses.near(positions, at, pose)
    }

    /// The exposure of the frame with this `index` of the film of the person in `slot`, whether it is trained
    /// on or not; neutral where exposures are not learned.
    pub fn exposure_near(&self, slot: usize, index: u32) -> FrameExposure {
        exposure::near(&self.model.state.exposures, slot, index)
    }

    /// Writes a checkpoint into `dir`.
    ///
    /// # Errors
    /// If a file can't be written.
    pub fn save(&self, dir: &Path) -> Result<(), TrainError> {
        let Self {
            run,
            data,
            model,
            known,
            best: _,
        } = self;
        let mut state = ModelState::new(
            model.config.clone(),
            model.joints,
            run.options().seed,
            Vec::new(),
        );
        run.record(&mut state);
        model.record(&mut state);
        known.record(&mut state);
        checkpoint::save_occupancy(dir, &model.state.occupancy)?;
        refinement_file::save(dir, &model.state.poses)?;
        exposure::file::save(dir, &model.state.exposures)?;
        for (slot, file) in known.kept_tracks() {
            refinement_file::keep(dir, *slot, file)?;
        }
        for subject in data.subjects() {
            if let Some(track) = refined_track(&model.state, subject) {
                refinement_file::save_track(dir, subject.slot, &track)?;
            }
        }
        checkpoint::save(dir, &state, model.state.avatar(), &model.state.optimiser)
    }

    /// The current model, for rendering.
    pub fn renderer(&self) -> Renderer {
        let model = &self.model;
        let device = model.device.clone().inner();
        let body = |slot: &Option<Skeleton>| {
            slot.clone()
                .map(|skeleton| CanonicalBody::new(skeleton, &model.config, &device))
        };
        let bodies = self.known.skeletons().iter().map(body).collect();
        Renderer::new(
            model.config.clone(),
            model.state.avatar().valid(),
            bodies,
            model.state.occupancy.clone(),
            self.run.schedule_progress(),
        )
        .without(self.known.erased().clone())
    }

    /// Share of the splats of this training's people whose colours are guessed, 0 to 1; `None` if none is.
    ///
    /// # Errors
    /// If the device fails.
    pub fn guessed(&self) -> Result<Option<f64>, TrainError> {
        let (model, subjects) = (&self.model, self.data.subjects());
        let mut sum = 0.0;
        for subject in subjects {
            sum += model.state.avatar().guessed_share(subject.own_slot)?;
        }
        Ok((sum > 0.0).then(|| sum / subjects.len() as f64))
    }

    /// Number of parameters that an additional person would add.
    pub fn parameters_of_a_person(&self) -> u64 {
        Avatar::parameters_of_a_person(&self.model.config, self.model.joints)
    }

    /// Number of parameters.
    pub fn parameters(&self) -> u64 {
        self.model.state.avatar().parameters() as u64
    }
}
