//! A model's knowledge of its people, by slot, whether they take part in the training or not.

use crate::train::frames::order::PersonSteps;
use crate::train::run::checkpoint::ModelState;
use std::collections::{BTreeMap, BTreeSet};
use yoto_capture::skeleton::Skeleton;

/// The state of people that a checkpoint keeps.
pub(crate) struct Known {
    slots: Vec<Option<Skeleton>>,
    /// Slots of people whose training changed only their own parameters.
    own_only: BTreeSet<usize>,
    /// The steps with the person in each slot.
    steps_per_person: Vec<PersonSteps>,
    /// Slots of people who were removed.
    erased: BTreeSet<usize>,
    /// The decoder by which guesses of the person in a slot are made.
    priors: BTreeMap<usize, String>,
    /// Refined pose tracks of people who do not take part: their slots and files.
    kept_tracks: Vec<(usize, Vec<u8>)>,
}

impl Known {
    /// The people of the checkpoint with the state `saved`.
    pub(super) fn new(saved: &ModelState, kept_tracks: Vec<(usize, Vec<u8>)>) -> Self {
        let mut steps_per_person = saved.steps_per_person.clone();
        steps_per_person.resize(saved.slots.len(), PersonSteps::default());
        Self {
            slots: saved.slots.clone(),
            own_only: saved.own_only.clone(),
            steps_per_person,
            erased: saved.erased.clone(),
            priors: saved.priors.clone(),
            kept_tracks,
        }
    }

    /// The skeleton of each slot.
    pub(super) fn skeletons(&self) -> &[Option<Skeleton>] {
        &self.slots
    }

    /// Whether the model knows the person in `slot`.
    pub(super) fn has_person(&self, slot: usize) -> bool {
        self.slots.get(slot).is_some_and(Option::is_some)
    }

    /// Whether the model knows anybody.
    pub(super) fn has_people(&self) -> bool {
        self.slots.iter().any(Option::is_some)
    }

    /// Makes the person in `slot` known.
    pub(super) fn add_person(&mut self, slot: usize, skeleton: Skeleton) {
        self.slots[slot] = Some(skeleton);
    }

    /// Notes by which decoder guesses of the person in `slot` are made.
    pub(super) fn note_prior(&mut self, slot: usize, prior: Option<String>) {
        match prior {
            Some(prior) => _ = self.priors.insert(slot, prior),
            None => _ = self.priors.remove(&slot),
        }
    }

    /// The steps with the person in `slot`.
    pub(super) fn steps_with(&self, slot: usize) -> PersonSteps {
        self.steps_per_person[slot]
    }

    /// Counts a step with the person in `slot`.
    pub(super) fn count_step(&mut self, slot: usize) {
        self.steps_per_person[slot].steps += 1;
    }

    /// Slots of people who were removed.
    pub(super) fn erased(&self) -> &BTreeSet<usize> {
        &self.erased
    }

    /// Slots and files of the refined pose tracks of people who do not take part.
    pub(super) fn kept_tracks(&self) -> &[(usize, Vec<u8>)] {
        &self.kept_tracks
    }

    /// Writes what a checkpoint keeps of people into `state`.
    pub(super) fn record(&self, state: &mut ModelState) {
        state.slots.clone_from(&self.slots);
        state.own_only.clone_from(&self.own_only);
        state.steps_per_person.clone_from(&self.steps_per_person);
        state.erased.clone_from(&self.erased);
        state.priors.clone_from(&self.priors);
    }
}
