//! How long and on what to train.

use crate::loss::lpips::LpipsWeights;

/// How long to train.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Budget {
    /// Seconds spent in steps.
    Seconds(f64),
    /// Steps.
    Steps(u64),
}

/// How to train.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainOptions {
    /// How long; the learning rate falls over it.
    pub budget: Budget,
    /// Seconds of the budget that were spent before.
    pub used_seconds: f64,
    /// Steps of the budget that were taken before.
    pub used_steps: u64,
    /// Of the initial weights and all drawing.
    pub seed: u64,
    /// Longest image side, pixels; 0 keeps the capture's.
    pub image_size: u32,
    /// Every n-th frame is kept out of training for validation; 0: none.
    pub holdout_every: usize,
    /// Weights of the networks of LPIPS; without them the objective has none.
    pub lpips: Option<LpipsWeights>,
}

impl Default for TrainOptions {
    /// A new run of five minutes on whole images, every frame trained on.
    fn default() -> Self {
        Self {
            budget: Budget::Seconds(300.0),
            used_seconds: 0.0,
            used_steps: 0,
            seed: 7,
            image_size: 0,
            holdout_every: 0,
            lpips: None,
        }
    }
}
