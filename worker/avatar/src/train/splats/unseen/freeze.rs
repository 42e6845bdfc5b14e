//! Guesses before the end of a run. Splats of the back look out around the outline in training frames, so that a
//! guess changes what those show. The rest of the run learns to do without the old colours, while the guessed ones are frozen:
//! their flags are part of the model, so that a resumed training continues with them, and everybody who gets the model can tell what is
//! guessed.

use super::guess_unseen;
use crate::train::TrainError;
use crate::train::model::Model;
use crate::train::people::TrainSubject;
use crate::train::run::Moment;
use crate::train::run::options::TrainOptions;

/// Share of a run after which guesses are frozen (docs/research/splats.md, "Sides that no frame shows").
const FROM: f64 = 0.6;

/// Guesses once what no frame shows of the `subjects` and freezes it, if the step at `now` is late in the run. Before
/// that, and if `options` leave what is unseen, everything learns.
pub(crate) fn update_frozen_colours(
    model: &mut Model,
    subjects: &[TrainSubject],
    options: &TrainOptions,
    now: Moment,
) -> Result<(), TrainError> {
    if options.leave_unseen || now.fraction < FROM {
        return unfreeze_colours(model, subjects);
    }
    let frozen = |subject: &TrainSubject| {
        let avatar = model.state.avatar();
        avatar.has_frozen_colours(subject.own_slot)
    };
    if !subjects.iter().all(frozen) {
        let prior = options.prior.decoder();
        guess_unseen(model, subjects, prior, now.schedule_progress)?;
    }
    Ok(())
}

/// Lets all colours of the splats of the `subjects` learn.
fn unfreeze_colours(model: &mut Model, subjects: &[TrainSubject]) -> Result<(), TrainError> {
    for subject in subjects {
        let slot = subject.own_slot;
        if model.state.avatar().has_frozen_colours(slot) {
            model.state.avatar_mut().freeze_colours(slot, None)?;
        }
    }
    Ok(())
}
