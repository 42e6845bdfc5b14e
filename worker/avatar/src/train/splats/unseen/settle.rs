//! Guesses before the end of a run. Splats of the back look out around the outline in training frames, so that a
//! guess changes what those show; the rest of the run learns to do without the old colours.

use super::guess_unseen;
use crate::train::TrainError;
use crate::train::model::Model;
use crate::train::people::TrainSubject;
use crate::train::run::Moment;

/// Share of a run after which guesses hold (docs/splats.md, "Sides that no frame shows").
const FROM: f64 = 0.6;
/// Steps after which guessed colours are restored. A colour moves by less than a tenth between.
const EVERY: u64 = 10;

/// The guessed colours of a person's splats.
pub(crate) struct Settled {
    /// The person's splats in the model.
    pub(super) slot: usize,
    /// `[N, 3]`.
    pub(super) colours: Vec<f32>,
    /// Whether the splat's is guessed.
    pub(super) anew: Vec<bool>,
}

impl Settled {
    /// Holds what is guessed about each person, after a step.
    pub fn hold(
        settled: &mut Option<Vec<Self>>,
        model: &mut Model,
        subjects: &[TrainSubject],
        now: Moment,
    ) -> Result<(), TrainError> {
        if now.fraction < FROM {
            return Ok(());
        }
        match settled {
            Some(settled) if now.step.is_multiple_of(EVERY) => {
                settled.iter().try_for_each(|it| it.restore(model))
            }
            Some(_) => Ok(()),
            None => {
                let (guessed, _) = guess_unseen(model, subjects, now.opened)?;
                *settled = Some(guessed);
                Ok(())
            }
        }
    }

    /// Restores the guessed colours.
    fn restore(&self, model: &mut Model) -> Result<(), TrainError> {
        let avatar = model.state.avatar_mut();
        let mut colours = avatar.splat_values(self.slot)?.colours;
        let pairs = colours.as_chunks_mut::<3>().0.iter_mut();
        let guessed = self.colours.as_chunks::<3>().0.iter().zip(&self.anew);
        for (own, (guessed, anew)) in pairs.zip(guessed) {
            if *anew {
                *own = *guessed;
            }
        }
        avatar.paint_splats(self.slot, &colours, &self.anew)?;
        Ok(())
    }
}
