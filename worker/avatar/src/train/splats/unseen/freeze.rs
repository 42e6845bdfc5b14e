//! Guesses before the end of a run. Splats of the back look out around the outline in training frames, so that a
//! guess changes what those show. The rest of the run learns to do without the old colours, while the guessed ones are frozen:
//! their flags are part of the model, so that a resumed training continues with them, and everybody who gets the model can tell what is
//! guessed.

use super::guess_unseen;
use crate::avatar::Avatar;
use crate::decoder::Decoder;
use crate::train::TrainError;
use crate::train::model::Model;
use crate::train::people::TrainSubject;
use crate::train::run::Moment;

/// Share of a run after which guesses are frozen (docs/research/splats.md, "Sides that no frame shows").
const FROM: f64 = 0.6;

/// Guesses once what no frame shows of the `subjects` and freezes it, if the step at `now` is late in the run; before
/// that, everything learns.
pub(crate) fn freeze_guesses(
    model: &mut Model,
    subjects: &[TrainSubject],
    prior: Option<&Decoder>,
    now: Moment,
) -> Result<(), TrainError> {
    let own = |subject: &TrainSubject| Avatar::own_slot(&model.config, subject.slot);
    let slots: Vec<usize> = subjects.iter().map(own).collect();
    let frozen = |slot: &usize| model.state.avatar().has_frozen_colours(*slot);
    if now.fraction < FROM {
        return unfreeze_colours(model, subjects);
    }
    if !slots.iter().all(frozen) {
        guess_unseen(model, subjects, prior, now.schedule_progress)?;
    }
    Ok(())
}

/// Lets all colours of the splats of the `subjects` learn.
pub(crate) fn unfreeze_colours(
    model: &mut Model,
    subjects: &[TrainSubject],
) -> Result<(), TrainError> {
    for subject in subjects {
        let slot = Avatar::own_slot(&model.config, subject.slot);
        if model.state.avatar().has_frozen_colours(slot) {
            model.state.avatar_mut().freeze_colours(slot, None)?;
        }
    }
    Ok(())
}
