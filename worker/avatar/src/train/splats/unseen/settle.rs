//! Guesses before the end of a run. Splats of the back look out around the outline in training frames, so that a
//! guess changes what those show. The rest of the run learns to do without the old colours, while the guessed ones are held:
//! their flags are part of the model, so that a resumed training goes on with them.

use super::guess_unseen;
use crate::avatar::Avatar;
use crate::train::TrainError;
use crate::train::model::Model;
use crate::train::people::TrainSubject;
use crate::train::run::Moment;

/// Share of a run after which guesses are held (docs/splats.md, "Sides that no frame shows").
const FROM: f64 = 0.6;

/// Guesses once what no frame shows of the `subjects` and holds it, if the step at `now` is late in the run; before that,
/// everything learns.
pub(crate) fn settle(
    model: &mut Model,
    subjects: &[TrainSubject],
    now: Moment,
) -> Result<(), TrainError> {
    let own = |subject: &TrainSubject| Avatar::own_slot(&model.config, subject.slot);
    let slots: Vec<usize> = subjects.iter().map(own).collect();
    let held = |slot: &usize| model.state.avatar().holds_splats(*slot);
    if now.fraction < FROM {
        let early: Vec<usize> = slots.into_iter().filter(held).collect();
        return release(model, &early);
    }
    if slots.iter().all(held) {
        return Ok(());
    }
    let (guesses, _) = guess_unseen(model, subjects, now.opened)?;
    for guess in guesses {
        let avatar = model.state.avatar_mut();
        avatar.hold_splats(guess.slot, Some(&guess.anew))?;
    }
    Ok(())
}

/// Lets all colours of the splats in `slots` learn again.
pub(super) fn release(model: &mut Model, slots: &[usize]) -> Result<(), TrainError> {
    for slot in slots {
        model.state.avatar_mut().hold_splats(*slot, None)?;
    }
    Ok(())
}
