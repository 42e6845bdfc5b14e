//! Start of a training, with a new model or a checkpoint.

use crate::avatar::Avatar;
use crate::config::{
    Appearance, ConfigError, LearnExposure, ModelConfig, Numerics, Refine, Variant,
};
use crate::decoder::parts::Parts;
use crate::identity::own;
use crate::loss::{Objective, PatchObjective};
use crate::render::occupancy::Occupancy;
use crate::train::data::Data;
use crate::train::frames::whole_picture::OBJECTIVE;
use crate::train::known::Known;
use crate::train::model::{Model, PatchLearning};
use crate::train::people::{TrainPerson, TrainSubject, check_people};
use crate::train::poses::decision::decide;
use crate::train::poses::refinement::PoseRefinement;
use crate::train::poses::refinement_file;
use crate::train::run::Run;
use crate::train::run::checkpoint::{self, ModelState};
use crate::train::run::guard::TrainState;
use crate::train::run::optimiser::optimiser;
use crate::train::run::options::TrainOptions;
use crate::train::splats::placing::place_initial_splats;
use crate::train::trainer::Trainer;
use crate::train::{TrainError, TrainProgress, exposure};
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
        people: Vec<TrainPerson>,
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
        Self::assemble(saved, options, &people, state, Vec::new(), device)
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
        people: Vec<TrainPerson>,
        device: &Device,
    ) -> Result<Self, TrainError> {
        let mut saved = ModelState::read(dir)?;
        let people: Vec<TrainPerson> = (people.into_iter())
            .map(|person| match saved.joints_of(person.slot) {
                Some(joints) => person.with_known_parts(joints),
                None => person,
            })
            .collect();
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
            state.poses = refinement_file::load(dir, |slot| saved.joints_of(slot))?;
        }
        if alone || saved.config.exposure.who != LearnExposure::Never {
            state.exposures = exposure::file::load(dir)?;
        }
        state.rate_scale = saved.rate_scale;
        saved.slots.resize(saved.slots.len().max(slots), None);
        let kept_tracks = refinement_file::others(dir, &people)?;
        Self::assemble(saved, options, &people, state, kept_tracks, device)
    }

    /// Replaces the default objective.
    ///
    /// # Errors
    /// If the model has splats: they learn from whole pictures by a loss with a backward pass of its own,
    /// and an [`Objective`] compares patches.
    pub fn with_objective(mut self, objective: Box<dyn Objective>) -> Result<Self, TrainError> {
        let name = objective.name();
        self.model.set_objective(objective)?;
        self.run.set_objective(name);
        Ok(self)
    }

    /// A trainer for `people`; each of them has a slot in `saved`.
    fn assemble(
        mut saved: ModelState,
        options: TrainOptions,
        people: &[TrainPerson],
        mut state: TrainState,
        kept_tracks: Vec<(usize, Vec<u8>)>,
        device: Device,
    ) -> Result<Self, TrainError> {
        let mut wanted = saved.config.clone();
        wanted.refinement.who = options.refine_poses.unwrap_or(wanted.refinement.who);
        wanted.exposure.who = options.exposure.unwrap_or(wanted.exposure.who);
        let only = options.learn.only();
        if let Some(degree) = options.harmonics {
            set_harmonics_degree(&mut wanted, &mut state, degree, only.is_some())?;
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
        let continues = continues(&saved, &options, people);
        options.learn.note(people, &mut saved);
        if let Some(slot) = only {
            state.change_avatar(|avatar| own::freeze_all_but(avatar, slot));
        }
        state.resize(saved.slots.len());
        let mut known = Known::new(&saved, kept_tracks);
        let mut subjects = Vec::with_capacity(people.len());
        let mut notes = Vec::new();
        for person in people {
            let subject = TrainSubject::new(person, &saved.config, &options, &device)?;
            notes.extend(begin(
                &mut state,
                &saved,
                &wanted,
                person,
                &subject,
                only.is_some(),
            )?);
            let placed = match saved.config.variant {
                Variant::NoIdentity => known.has_people(),
                _ => known.has_person(person.slot),
            };
            notes.extend(place_initial_splats(
                &mut state,
                &saved.config,
                saved.schedule_progress,
                &subject,
                placed,
            )?);
            let poses = subject.frames.iter().map(|frame| &frame.pose);
            let avatar = state.avatar_mut();
            avatar.record_pose_range(subject.own_slot, poses)?;
            known.add_person(person.slot, subject.body.skeleton.clone());
            known.note_prior(person.slot, prior_of(&saved.config, &options, &subject));
            subjects.push(subject);
        }
        let (patches, objective) = match saved.config.appearance {
            Appearance::Splats(_) => {
                if options.lpips.is_some() {
                    notes.push("splats learn without LPIPS".to_owned());
                }
                (None, OBJECTIVE)
            }
            Appearance::Field(_) => {
                let patches = patches(&saved.config, &options, &subjects, &device)?;
                let name = patches.objective.name();
                (Some(patches), name)
            }
        };
        let progress = TrainProgress {
            objective,
            notes,
            ..TrainProgress::default()
        };
        Ok(Self {
            data: Data::new(subjects, saved.config.sampling, saved.seed),
            model: Model::new(&saved, state, device, patches),
            run: Run::new(&saved, options, continues, progress),
            known,
            best: None,
        })
    }
}

/// Begins or goes on with what is learned of the film of a `person`, who may be trained `alone`: occupancy, poses and
/// exposures. Returns a note on whether poses are refined.
fn begin(
    state: &mut TrainState,
    saved: &ModelState,
    wanted: &ModelConfig,
    person: &TrainPerson,
    subject: &TrainSubject,
    alone: bool,
) -> Result<Option<String>, TrainError> {
    let (slot, track) = (person.slot, &person.shard.track);
    let known = state.occupancy[slot].take();
    let march = saved.config.appearance.march();
    let grid = march.and_then(|march| Occupancy::new(&subject.body.grid, march));
    state.occupancy[slot] = grid.map(|grid| grid.with_levels_of(known.as_ref()));
    let known = state.poses[slot].take();
    let cheap = saved.config.appearance.capabilities().fast_frames;
    let decision = decide(wanted.refinement.who, person, cheap)?;
    if let Some(extent) = decision.refine {
        // Another film of the same person starts anew.
        let known = known.filter(|known| known.is_of(track));
        // The schedule of a model that stays as it is stands still.
        let late = alone || saved.schedule_progress >= saved.config.refinement.end;
        let fresh = || PoseRefinement::new(track, extent, late);
        state.poses[slot] = Some(known.unwrap_or_else(fresh));
    }
    let known = state.exposures[slot].take();
    state.exposures[slot] = exposure::begin(&wanted.exposure, track, known);
    Ok(decision.why)
}

/// How a model with a field compares patches, which are no larger than any frame.
fn patches(
    config: &ModelConfig,
    options: &TrainOptions,
    subjects: &[TrainSubject],
    device: &Device,
) -> Result<PatchLearning, TrainError> {
    let size = subjects
        .iter()
        .flat_map(TrainSubject::size)
        .fold(config.optimise.patch_size as usize, usize::min);
    let weight = config.optimise.ssim_weight;
    let objective = PatchObjective::with_weights(options.lpips.as_ref(), weight, size, device)?;
    Ok(PatchLearning {
        objective: Box::new(objective),
        size,
    })
}

/// Lets colours depend on the view by harmonics of up to `degree`. In a model that stays as it is for all but one
/// person, they already do.
fn set_harmonics_degree(
    wanted: &mut ModelConfig,
    state: &mut TrainState,
    degree: usize,
    only: bool,
) -> Result<(), TrainError> {
    let fail = |message: String| {
        let field = "harmonics";
        Err(TrainError::Config(ConfigError::Field { field, message }))
    };
    match &mut wanted.appearance {
        Appearance::Field(_) if degree == 0 => Ok(()),
        Appearance::Field(_) => fail(format!(
            "the tier {} has a field, whose colours do not depend on the view",
            wanted.tier
        )),
        Appearance::Splats(splats) if only && splats.harmonics != degree => fail(format!(
            "the model's are of degree {}: a training of one person leaves it",
            splats.harmonics
        )),
        Appearance::Splats(splats) => {
            splats.harmonics = degree;
            splats.check()?;
            Ok(state.avatar_mut().set_harmonics_degree(degree)?)
        }
    }
}

/// Whether the budget goes on with a model that was trained with all of the `people` before. The state
/// `saved` tells, if an earlier part of the same budget wrote it; somebody new needs full rates.
fn continues(saved: &ModelState, options: &TrainOptions, people: &[TrainPerson]) -> bool {
    if options.used_steps > 0 || options.used_seconds > 0.0 {
        return saved.continues;
    }
    let known = |person: &TrainPerson| saved.slots.get(person.slot).is_some_and(Option::is_some);
    saved.step > 0 && people.iter().all(known)
}

/// The decoder by which guesses of `subject` are made in this training.
fn prior_of(
    config: &ModelConfig,
    options: &TrainOptions,
    subject: &TrainSubject,
) -> Option<String> {
    let guesses = config.appearance.guesses_unseen() && !options.leave_unseen;
    // Other skeletons have no places that correspond to those of people.
    let places = Parts::of(&subject.body.skeleton).is_some();
    options.prior.name().filter(|_| guesses && places)
}
