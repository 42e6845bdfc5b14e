//! What is known of the steps with one person.

use serde::{Deserialize, Serialize};

/// Weight of the newest loss in the smoothed one.
const SMOOTHING: f64 = 0.05;

/// The steps with one person.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Practice {
    /// Their number, over the model's life.
    pub steps: u64,
    /// Smoothed loss; `None` before the first step.
    pub loss: Option<f64>,
}

impl Practice {
    /// Takes note of a step, and of its loss if it was taken.
    pub(in super::super) fn note(&mut self, loss: Option<f64>) {
        self.steps += 1;
        let Some(new) = loss else { return };
        self.loss = Some(match self.loss {
            Some(old) => old + SMOOTHING * (new - old),
            None => new,
        });
    }
}
