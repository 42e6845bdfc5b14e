//! Beginning a training: a new model, or a checkpoint to go on with.

use super::checkpoint::{self, ModelState};
use super::frame_order::FrameOrder;
use super::guard::{Guard, TrainState};
use super::optimiser::optimiser;
use super::options::TrainOptions;
use super::people::{Person, TrainSubject, check_people};
use super::trainer::Trainer;
use super::{TrainError, TrainProgress};
use crate::avatar::Avatar;
use crate::config::{ConfigError, ModelConfig, Numerics};
use crate::loss::{Objective, PatchObjective};
use crate::ops::mlp::check_device;
use crate::render::occupancy::Occupancy;
use burn::tensor::Device;
use std::path::Path;

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
        let saved = ModelState::new(config.clone(), joints, options.seed, vec![None; slots]);
        let state = TrainState::new(avatar, optimiser(&config.optimise));
        Self::assemble(saved, options, &people, state, device)
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
        let saved = ModelState::read(dir)?;
        let (slots, joints) = check_people(&people)?;
        if joints != saved.joints {
            return Err(TrainError::People(format!(
                "the checkpoint's skeletons have {} joints, the people's have {joints}",
                saved.joints
            )));
        }
        let device = device.clone().inner().autodiff();
        let mut state = TrainState::new(
            checkpoint::load_avatar(dir, &saved, slots, &device)?,
            checkpoint::load_optimiser(dir, optimiser(&saved.config.optimise))?,
        );
        state.occupancy = checkpoint::load_occupancy(dir, &saved)?;
        state.rate_scale = saved.rate_scale;
        Self::assemble(saved, options, &people, state, device)
    }

    fn assemble(
        saved: ModelState,
        options: TrainOptions,
        people: &[Person],
        mut state: TrainState,
        device: Device,
    ) -> Result<Self, TrainError> {
        check_device(saved.config.precision, &device)?;
        if saved.config.numerics == Numerics::Reference {
            return Err(TrainError::Config(ConfigError::Field {
                field: "numerics",
                message: "a model trains with sound numerics; reference ones only render".into(),
            }));
        }
        let mut slots = saved.slots;
        let needed = people
            .iter()
            .map(|person| person.slot + 1)
            .max()
            .unwrap_or(0);
        slots.resize(slots.len().max(needed), None);
        state.occupancy.resize(slots.len(), None);
        let mut subjects = Vec::with_capacity(people.len());
        for person in people {
            let subject = TrainSubject::new(
                person,
                &saved.config,
                options.image_size,
                options.holdout_every,
                &device,
            )?;
            let known = state.occupancy[person.slot].take();
            state.occupancy[person.slot] = Occupancy::new(&subject.body.grid, &saved.config.march)
                .map(|grid| grid.taught_by(known.as_ref()));
            slots[person.slot] = Some(subject.body.skeleton.clone());
            subjects.push(subject);
        }
        let smallest = subjects
            .iter()
            .flat_map(|t| &t.frames)
            .map(|f| f.image.width.min(f.image.height))
            .min();
        let patch_size = (saved.config.optimise.patch_size as usize).min(smallest.unwrap_or(1));
        let objective = PatchObjective::with_weights(
            options.lpips.as_ref(),
            saved.config.optimise.ssim_weight,
            patch_size,
            &device,
        )?;
        let progress = TrainProgress {
            objective: objective.name(),
            ..TrainProgress::default()
        };
        let counts: Vec<usize> = subjects.iter().map(|it| it.frames.len()).collect();
        Ok(Self {
            order: FrameOrder::new(saved.seed, &counts),
            options: TrainOptions {
                seed: saved.seed,
                ..options
            },
            config: saved.config,
            subjects,
            slots,
            joints: saved.joints,
            state,
            guard: Guard::new(saved.skipped_steps, saved.rollbacks),
            objective: Box::new(objective),
            patch_size,
            device,
            step: saved.step,
            seconds: saved.train_seconds,
            opened: saved.progress,
            budget_steps: options.used_steps,
            budget_seconds: options.used_seconds,
            progress,
        })
    }
}
