//! The best state of a run. Training goes on from each state whatever it measures; what a run leaves is the best.

use crate::train::run::guard::{Snapshot, TrainState};

/// Difference by which the end must be worse than an earlier state to be given up for it, dB: a few held-out
/// frames do not measure more exactly.
const CLEARLY: f64 = 0.1;

/// The state with the highest PSNR on held-out frames so far.
pub(crate) struct Best {
    /// dB.
    psnr: f64,
    /// Number of the step after which it was measured.
    step: u64,
    snapshot: Snapshot,
}

impl Best {
    /// The better of what is known and the present `state`, which measures `psnr` after `step` steps.
    pub(crate) fn of(
        known: Option<Self>,
        state: &TrainState,
        psnr: f64,
        step: u64,
    ) -> Option<Self> {
        match known {
            Some(known) if known.psnr >= psnr => Some(known),
            known if !psnr.is_finite() => known,
            _ => Some(Self {
                psnr,
                step,
                snapshot: Snapshot::of(state),
            }),
        }
    }

    /// Makes `state`, which measures `psnr`, what it was when it measured clearly more. Returns a note on it for
    /// people, or nothing if it stays.
    pub(crate) fn return_to(&self, state: &mut TrainState, psnr: f64) -> Option<String> {
        (psnr <= self.psnr - CLEARLY).then(|| {
            self.snapshot.restore(state);
            let Self { psnr: best, step, .. } = self;
            format!(
                "held-out frames measured {best:.2} dB after step {step} and {psnr:.2} dB at the end: the better \
                 state is kept"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::avatar::Avatar;
    use crate::config::ModelConfig;
    use crate::train::run::optimiser::optimiser;
    use burn::tensor::Device;

    fn colours(state: &TrainState) -> Vec<f32> {
        let splats = state.avatar().splat_values(0).expect("reads");
        splats.colours
    }

    #[test]
    fn a_state_that_is_clearly_worse_is_given_up_for_the_best() {
        let mut config = ModelConfig::named("splat", "yoto").expect("a tier");
        config.appearance.splats_mut().expect("splats").count = 64;
        let avatar = Avatar::new(&config, 1, 24, 3, &Device::flex().autodiff());
        let mut state = TrainState::new(avatar, optimiser(&config));
        let good = colours(&state);
        let best = Best::of(None, &state, 30.0, 100);
        let worse = vec![0.25; good.len()];
        let anew = vec![false; good.len() / 3];
        let avatar = state.avatar_mut();
        avatar.paint_splats(0, &worse, &anew).expect("paints");
        let best = Best::of(best, &state, 29.0, 200).expect("the first");
        assert_eq!(best.return_to(&mut state, 29.95), None, "within the noise");
        assert_eq!(colours(&state), worse);
        let note = best.return_to(&mut state, 29.0).expect("a note");
        assert!(note.contains("30.00 dB after step 100"), "{note}");
        assert_eq!(colours(&state), good);
        let unmeasured = Best::of(None, &state, f64::NAN, 1);
        assert!(unmeasured.is_none());
    }
}
