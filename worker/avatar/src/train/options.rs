//! Budget and data of a training.

use crate::loss::lpips::LpipsWeights;

/// How long to train.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Budget {
    /// Seconds spent in steps.
    Seconds(f64),
    /// Number of steps.
    Steps(u64),
}

/// How to train.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainOptions {
    /// Length, over which the learning rate decays.
    pub budget: Budget,
    /// Seconds of the budget that are already used.
    pub used_seconds: f64,
    /// Steps of the budget that are already used.
    pub used_steps: u64,
    /// Seed of the initial weights and of all random draws.
    pub seed: u64,
    /// Longest image side, pixels; 0 keeps the capture's.
    pub image_size: u32,
    /// Every n-th frame is held out for validation; 0: none.
    pub holdout_every: usize,
    /// Weights of the networks of LPIPS; without them the objective has none.
    pub lpips: Option<LpipsWeights>,
}

impl Default for TrainOptions {
    /// A new run of five minutes on all frames at full size.
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
