//! Progress of a training, as a plain value: callers decide how to show it.

use crate::loss::LossTerm;
use crate::render::SampleCounts;

/// Progress of a training.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrainProgress {
    /// Steps over the model's life.
    pub step: u64,
    /// Steps at the end of the budget; 0 while the budget is in seconds.
    pub total_steps: u64,
    /// Share of the budget that is used, 0 to 1.
    pub fraction: f64,
    /// Smoothed speed.
    pub steps_per_second: f64,
    /// Smoothed loss.
    pub loss: f64,
    /// Terms of the objective by name, smoothed and unweighted.
    pub loss_terms: Vec<(&'static str, f64)>,
    /// Mean PSNR of held-out frames, dB, once measured.
    pub psnr: Option<f64>,
    /// Mean PSNR within the box around the person, dB, once measured.
    pub psnr_mask_box: Option<f64>,
    /// Number of held-out frames that were measured.
    pub held_out: u32,
    /// Mean SSIM of held-out frames, once measured; absent if they are smaller than its window.
    pub ssim: Option<f64>,
    /// Estimated remaining seconds of the budget.
    pub seconds_left: f64,
    /// Steps skipped because loss or gradients were not finite.
    pub skipped_steps: u64,
    /// Returns to an earlier state.
    pub rollbacks: u64,
    /// Share of samples that were evaluated, smoothed.
    pub live_fraction: f64,
    /// Sample counts of all steps since the trainer was created.
    pub samples: SampleCounts,
    /// Scheduled parts of the model that are active.
    pub active_parts: Vec<String>,
    /// The people whose poses are refined and why, in words.
    pub notes: Vec<String>,
    /// Name of the objective, e.g. "mse+ssim".
    pub objective: &'static str,
    /// Seconds of this budget spent in steps.
    pub train_seconds: f64,
}

impl TrainProgress {
    /// Adds the `values` of a step's `terms`; `smoothed` combines an old figure with a new one.
    pub(crate) fn note_terms(
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
