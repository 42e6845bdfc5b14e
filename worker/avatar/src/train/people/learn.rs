//! The parameters that a training changes: all, or those of one person in a model whose shared weights are trained.

use crate::config::Variant;
use crate::train::run::checkpoint::ModelState;
use crate::train::{TrainError, TrainPerson};

/// The parameters that a training changes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Learn {
    /// All.
    #[default]
    Everything,
    /// Only those of the person in a slot, who is the only one to train on: their code, tables, motion
    /// weights or splats, and what is known of their film. Everybody else renders bit for bit as before.
    Own {
        /// The person's slot.
        slot: usize,
    },
}

impl Learn {
    /// The slot of the only person who changes, if there is one.
    pub fn only(self) -> Option<usize> {
        match self {
            Self::Everything => None,
            Self::Own { slot } => Some(slot),
        }
    }

    /// Checks that these `people` can be trained in this way. `before` is the checkpoint that the training resumes.
    pub(crate) fn check(
        self,
        people: &[TrainPerson],
        before: Option<&ModelState>,
    ) -> Result<(), TrainError> {
        if let Some(state) = before
            && let Some(gone) = people.iter().find(|it| state.erased.contains(&it.slot))
        {
            return Err(TrainError::People(format!(
                "{}: slot {} is that of somebody who was removed from the model, and is never used again",
                gone.name, gone.slot
            )));
        }
        let Some(slot) = self.only() else {
            return Ok(());
        };
        let refused = |message: String| Err(TrainError::People(message));
        let [person] = people else {
            return refused(format!(
                "{} people: only one can be trained alone",
                people.len()
            ));
        };
        if person.slot != slot {
            return refused(format!(
                "{} is in slot {}, not in slot {slot}",
                person.name, person.slot
            ));
        }
        let name = &person.name;
        let Some(state) = before.filter(|state| state.step > 0) else {
            return refused(format!(
                "{name} can't join a model that is untrained: train it first, with {name} or without"
            ));
        };
        match state.config.variant {
            Variant::Yoto | Variant::NoPoseCondition => Ok(()),
            // Without identities nothing is a person's own, and the other has one person.
            variant @ (Variant::NoIdentity | Variant::HumanNerf) => refused(format!(
                "in a model of the variant {} nothing is a person's own, so that {name} can't be trained \
                 alone: train everybody",
                variant.name()
            )),
        }
    }

    /// Records in `state` which parameters learn from the `people`.
    pub(crate) fn note(self, people: &[TrainPerson], state: &mut ModelState) {
        for person in people {
            let slot = person.slot;
            let is_new = state.slots.get(slot).is_none_or(Option::is_none);
            match self {
                Self::Everything => _ = state.own_only.remove(&slot),
                Self::Own { .. } if is_new => _ = state.own_only.insert(slot),
                Self::Own { .. } => {}
            }
        }
    }
}
