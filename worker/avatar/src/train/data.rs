//! The people that a training learns from, and the order of their frames.

use crate::config::SamplingConfig;
use crate::train::frames::order::{FrameIndex, FrameOrder, PersonSteps};
use crate::train::known::Known;
use crate::train::people::{TrainFrame, TrainSubject};

/// People, and the order of their frames.
pub(crate) struct Data {
    subjects: Vec<TrainSubject>,
    order: FrameOrder,
}

impl Data {
    /// The `subjects`, at least one, each with at least one frame.
    pub(super) fn new(subjects: Vec<TrainSubject>, sampling: SamplingConfig, seed: u64) -> Self {
        let counts: Vec<usize> = subjects.iter().map(|it| it.frames.len()).collect();
        Self {
            order: FrameOrder::new(sampling, seed, &counts),
            subjects,
        }
    }

    /// The frame of a step.
    pub(super) fn at(&mut self, step: u64, known: &Known) -> FrameIndex {
        let slots = self.subjects.iter().map(|it| it.slot);
        let steps_per_person: Vec<PersonSteps> = slots.map(|slot| known.steps_with(slot)).collect();
        self.order.at(step, &steps_per_person)
    }

    /// A frame, and its person.
    pub(super) fn frame(&self, index: FrameIndex) -> (&TrainSubject, &TrainFrame) {
        let subject = &self.subjects[index.subject];
        (subject, &subject.frames[index.frame])
    }

    /// All people.
    pub(super) fn subjects(&self) -> &[TrainSubject] {
        &self.subjects
    }

    /// The person in `slot`, if they take part.
    pub(super) fn in_slot(&self, slot: usize) -> Option<&TrainSubject> {
        self.subjects.iter().find(|it| it.slot == slot)
    }
}
