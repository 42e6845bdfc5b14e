//! Start of a training, with a new model or a checkpoint.

use super::checkpoint::{self, ModelState};
use super::exposure;
use super::frame_order::{FrameOrder, Practice};
use super::guard::{Guard, TrainState};
use super::optimiser::optimiser;
use super::options::TrainOptions;
use super::people::{Person, TrainSubject, check_people};
use super::placing::place_first;
use super::refinement::PoseRefinement;
use super::refinement_file;
use super::trainer::Trainer;
use super::whole_picture::OBJECTIVE;
use super::{TrainError, TrainProgress, whose_poses};
use crate::avatar::Avatar;
use crate::config::{
    Appearance, ConfigError, LearnExposure, ModelConfig, Numerics, Refine, Variant,
};
use crate::identity::own;
use crate::loss::{Objective, PatchObjective};
use crate::render::occupancy::Occupancy;
use burn::tensor::Device;
use std::path::Path;

impl Trainer {
    /// Trains a new model of `people` on `device`.
    ///
    /// # Errors
    /// If the configuration is invalid, or the people don't fit one model.
    pub fn new(
        config: ModelConfig,
        options: TrainOptions,
        people: Vec<Person>,
        device: &Device,
    ) -> Result<Self, TrainError> {
        config.check()?;
        let (slots, joints) = check_people(&people)?;
        options.learn.check(&people, None)?;
        let device = device.clone().inner();
        config.check_device(&device)?;
        let device = device.autodiff();
        let avatar = Avatar::new(&config, slots, joints, options.seed, &device);
        let saved = ModelState::new(config.clone(), joints, options.seed, vec![None; slots]);
        let state = TrainState::new(avatar, optimiser(&config));
        Self::assemble(saved, options, &people, state, device)
    }

    /// Continues from a checkpoint of [`Self::save`] in `dir`, with the checkpoint's seed. People in
    /// slots that the checkpoint lacks start with new codes, tables, splats and residuals; with
    /// [`Learn::Own`](super::Learn::Own), such a person joins a model that stays as it is.
    ///
    /// # Errors
    /// If files are missing or damaged, or the people don't fit the model.
    pub fn resume(
        dir: &Path,
        options: TrainOptions,
        people: Vec<Person>,
        device: &Device,
    ) -> Result<Self, TrainError> {
        let mut saved = ModelState::read(dir)?;
        let (slots, joints) = check_people(&people)?;
        if joints != saved.joints {
            return Err(TrainError::People(format!(
                "the checkpoint's skeletons have {} joints, the people's have {joints}",
                saved.joints
            )));
        }
        options.learn.check(&people, Some(&saved))?;
        let device = device.clone().inner();
        saved.config.check_device(&device)?;
        let device = device.autodiff();
        let mut state = TrainState::new(
            checkpoint::load_avatar(dir, &saved, slots, &device)?,
            checkpoint::load_optimiser(dir, optimiser(&saved.config))?,
        );
        state.occupancy = checkpoint::load_occupancy(dir, &saved)?;
        // What is known of people who do not take part stays known.
        let alone = options.learn.only().is_some();
        if alone || saved.config.refinement.who != Refine::Never {
            state.poses = refinement_file::load(dir, saved.joints)?;
        }
        if alone || saved.config.exposure.who != LearnExposure::Never {
            state.exposures = exposure::file::load(dir)?;
        }
        state.rate_scale = saved.rate_scale;
        saved.slots.resize(saved.slots.len().max(slots), None);
        let mut trainer = Self::assemble(saved, options, &people, state, device)?;
        trainer.kept_tracks = refinement_file::others(dir, &people)?;
        Ok(trainer)
    }

    /// Replaces the default objective.
    ///
    /// # Errors
    /// If the model has splats: they learn from whole pictures by a loss with a backward pass of its own,
    /// and an [`Objective`] compares patches.
    pub fn with_objective(mut self, objective: Box<dyn Objective>) -> Result<Self, TrainError> {
        if self.config.appearance.splats().is_some() {
            return Err(TrainError::Objective {
                objective: objective.name(),
                tier: self.config.tier.clone(),
            });
        }
        self.progress.objective = objective.name();
        self.objective = objective;
        Ok(self)
    }

    /// A trainer of `people`, each of whom has a slot in `saved`.
    fn assemble(
        mut saved: ModelState,
        options: TrainOptions,
        people: &[Person],
        mut state: TrainState,
        device: Device,
    ) -> Result<Self, TrainError> {
        let mut wanted = saved.config.clone();
        wanted.refinement.who = options.refine_poses.unwrap_or(wanted.refinement.who);
        wanted.exposure.who = options.exposure.unwrap_or(wanted.exposure.who);
        let only = options.learn.only();
        if let Some(degree) = options.harmonics {
            reach_harmonics(&mut wanted, &mut state, degree, only.is_some())?;
        }
        wanted.check()?;
        // What is wanted for one person says nothing about the others.
        if only.is_none() {
            saved.config = wanted.clone();
        }
        if saved.config.numerics == Numerics::Reference {
            return Err(TrainError::Config(ConfigError::Field {
                field: "numerics",
                message: "a model trains with sound numerics; reference ones only render".into(),
            }));
        }
        let goes_on = goes_on(&saved, &options, people);
        options.learn.note(people, &mut saved);
        if let Some(slot) = only {
            state.change_avatar(|avatar| own::freeze_all_but(avatar, slot));
        }
        let mut slots = saved.slots;
        state.occupancy.resize(slots.len(), None);
        saved.practice.resize(slots.len(), Practice::default());
        state.poses.resize(slots.len(), None);
        state.exposures.resize(slots.len(), None);
        let mut subjects = Vec::with_capacity(people.len());
        let mut notes = Vec::new();
        for person in people {
            let subject = TrainSubject::new(person, &saved.config, &options, &device)?;
            let known = state.occupancy[person.slot].take();
            let field = saved.config.appearance.field();
            let grid = field.and_then(|it| Occupancy::new(&subject.body.grid, &it.march));
            state.occupancy[person.slot] = grid.map(|grid| grid.taught_by(known.as_ref()));
            let known = state.poses[person.slot].take();
            let decision = whose_poses::decide(wanted.refinement.who, person)?;
            notes.extend(decision.why);
            if decision.refine {
                let track = &person.shard.track;
                // Another film of the same person starts anew.
                let known = known.filter(|known| known.is_of(track));
                // The schedule of a model that stays as it is stands still.
                let late = only.is_some() || saved.progress >= saved.config.refinement.end;
                let fresh = || PoseRefinement::new(track, late);
                state.poses[person.slot] = Some(known.unwrap_or_else(fresh));
            }
            let known = state.exposures[person.slot].take();
            let track = &person.shard.track;
            state.exposures[person.slot] = exposure::begin(&wanted.exposure, track, known);
            let known = match saved.config.variant {
                Variant::NoIdentity => slots.iter().any(Option::is_some),
                _ => slots[person.slot].is_some(),
            };
            place_first(&mut state, &saved.config, saved.progress, &subject, known)?;
            slots[person.slot] = Some(subject.body.skeleton.clone());
            subjects.push(subject);
        }
        // Patches are no larger than any frame.
        let patch_size = subjects
            .iter()
            .flat_map(TrainSubject::size)
            .fold(saved.config.optimise.patch_size as usize, usize::min);
        let objective = PatchObjective::with_weights(
            options.lpips.as_ref(),
            saved.config.optimise.ssim_weight,
            patch_size,
            &device,
        )?;
        if saved.config.appearance.splats().is_some() && options.lpips.is_some() {
            notes.push("splats learn without LPIPS".to_owned());
        }
        let progress = TrainProgress {
            objective: match saved.config.appearance {
                Appearance::Splats(_) => OBJECTIVE,
                Appearance::Field(_) => objective.name(),
            },
            notes,
            ..TrainProgress::default()
        };
        let counts: Vec<usize> = subjects.iter().map(|it| it.frames.len()).collect();
        Ok(Self {
            order: FrameOrder::new(saved.config.sampling, saved.seed, &counts),
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
            own_only: saved.own_only,
            practice: saved.practice,
            erased: saved.erased,
            kept_tracks: Vec::new(),
            goes_on,
            budget_steps: options.used_steps,
            budget_seconds: options.used_seconds,
            progress,
            previews: Vec::new(),
        })
    }
}

/// Lets colours depend on the view by harmonics of up to `degree`. In a model that stays as it is for all but one
/// person, they already do.
fn reach_harmonics(
    wanted: &mut ModelConfig,
    state: &mut TrainState,
    degree: usize,
    only: bool,
) -> Result<(), TrainError> {
    let fail = |message: String| {
        let field = "harmonics";
        Err(TrainError::Config(ConfigError::Field { field, message }))
    };
    match wanted.appearance.splats_mut() {
        None if degree == 0 => Ok(()),
        None => fail(format!(
            "the tier {} has a field, whose colours do not depend on the view",
            wanted.tier
        )),
        Some(splats) if only && splats.harmonics != degree => fail(format!(
            "the model's are of degree {}: a training of one person leaves it",
            splats.harmonics
        )),
        Some(splats) => {
            splats.harmonics = degree;
            splats.check()?;
            Ok(state.avatar_mut().reach_harmonics(degree)?)
        }
    }
}

/// Whether the budget goes on with a model that was trained with all of the `people` before. The state
/// `saved` tells, if an earlier part of the same budget wrote it; somebody new needs full rates.
fn goes_on(saved: &ModelState, options: &TrainOptions, people: &[Person]) -> bool {
    if options.used_steps > 0 || options.used_seconds > 0.0 {
        return saved.goes_on;
    }
    let known = |person: &Person| saved.slots.get(person.slot).is_some_and(Option::is_some);
    saved.step > 0 && people.iter().all(known)
}
