//! What a trainer reports while it trains. A plain value: the caller decides how to show it.

use crate::loss::LossTerm;
use crate::render::SampleCounts;

/// A moment of a training.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrainProgress {
    /// Steps taken over the model's life.
    pub step: u64,
    /// Steps at the end of the budget; 0 while the budget is in seconds.
    pub total_steps: u64,
    /// Share of the budget that is used, 0 to 1.
    pub fraction: f64,
    /// Over the last few seconds.
    pub steps_per_second: f64,
    /// Smoothed.
    pub loss: f64,
    /// The objective's terms, by name, smoothed, without their weights.
    pub loss_terms: Vec<(&'static str, f64)>,
    /// Of held-out frames, dB, once measured.
    pub psnr: Option<f64>,
    /// Of held-out frames, once measured.
    pub ssim: Option<f64>,
    /// Of the budget.
    pub seconds_left: f64,
    /// Steps not taken because loss or gradients were not finite.
    pub skipped_steps: u64,
    /// Returns to an earlier state.
    pub rollbacks: u64,
    /// Share of samples that the networks saw, smoothed.
    pub live_fraction: f64,
    /// How many samples came how far, in all steps of this budget.
    pub samples: SampleCounts,
    /// Parts of the model that take part only from some moment of the run on, and do so now.
    pub active_parts: Vec<String>,
    /// E.g. "mse+ssim".
    pub objective: &'static str,
    /// Seconds spent in steps in this budget.
    pub train_seconds: f64,
}

impl TrainProgress {
    /// Takes in the `values` of a step's `terms`; `smoothed` joins an old figure and a new one.
    pub(super) fn note_terms(
        &mut self,
        terms: &[LossTerm],
        values: &[f32],
        smoothed: impl Fn(f64, f64) -> f64,
    ) {
        for (term, value) in terms.iter().zip(values) {
            let value = f64::from(*value);
            match self
                .loss_terms
                .iter_mut()
                .find(|(name, _)| *name == term.name)
            {
                Some((_, old)) => *old = smoothed(*old, value),
                None => self.loss_terms.push((term.name, value)),
            }
        }
    }
}
