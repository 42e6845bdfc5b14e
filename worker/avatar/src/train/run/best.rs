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
    pub fn of(known: Option<Self>, state: &TrainState, psnr: f64, step: u64) -> Option<Self> {
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
    pub fn return_to(&self, state: &mut TrainState, psnr: f64) -> Option<String> {
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
