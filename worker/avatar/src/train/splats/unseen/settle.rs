//! Guesses before the end of a run. Splats of the back look out around the outline in training frames, so that a
//! guess changes what those show. The rest of the run learns to do without the old colours, while the guessed ones are held:
//! their flags are part of the model, so that a resumed training goes on with them, and whoever gets the model knows what is
//! guessed.

use super::guess_unseen;
use crate::avatar::Avatar;
use crate::decoder::Decoder;
use crate::train::TrainError;
use crate::train::model::Model;
use crate::train::people::TrainSubject;
use crate::train::run::Moment;

/// Share of a run after which guesses are held (docs/research/splats.md, "Sides that no frame shows").
const FROM: f64 = 0.6;

/// Guesses once what no frame shows of the `subjects` and holds it, if the step at `now` is late in the run; before that,
/// everything learns.
pub(crate) fn settle(
    model: &mut Model,
    subjects: &[TrainSubject],
    prior: Option<&Decoder>,
    now: Moment,
) -> Result<(), TrainError> {
    let own = |subject: &TrainSubject| Avatar::own_slot(&model.config, subject.slot);
    let slots: Vec<usize> = subjects.iter().map(own).collect();
    let held = |slot: &usize| model.state.avatar().holds_splats(*slot);
    if now.fraction < FROM {
        return release(model, subjects);
    }
    if !slots.iter().all(held) {
        guess_unseen(model, subjects, prior, now.opened)?;
    }
    Ok(())
}

/// Lets all colours of the splats of the `subjects` learn.
pub(crate) fn release(model: &mut Model, subjects: &[TrainSubject]) -> Result<(), TrainError> {
    for subject in subjects {
        let slot = Avatar::own_slot(&model.config, subject.slot);
        if model.state.avatar().holds_splats(slot) {
            model.state.avatar_mut().hold_splats(slot, None)?;
        }
    }
    Ok(())
}
