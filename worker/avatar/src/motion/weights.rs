//! Learned motion weights, the `direct` form: logits on the canonical grid, shared by all
//! identities, and a residual for each.

use crate::init::Initial;
use burn::module::{Module, Param};
use burn::tensor::Tensor;
use burn::tensor::activation::softmax;

/// Logits of the motion weights, all 0 at the start: the prior serves.
#[derive(Module, Debug)]
pub struct MotionWeights {
    /// `[K + 1, D³]`.
    base: Param<Tensor<2>>,
    /// One `[K + 1, D³]` an identity.
    residuals: Vec<Param<Tensor<2>>>,
}

impl MotionWeights {
    pub(crate) fn new(init: &Initial, slots: usize, channels: usize, voxels: usize) -> Self {
        Self {
            base: init.zeros("motion.base", [channels, voxels]),
            residuals: (0..slots)
                .map(|slot| init.zeros(&format!("motion.residuals.{slot}"), [channels, voxels]))
                .collect(),
        }
    }

    /// `[K + 1, D³]`: softmax over channels of logits plus `log_prior`.
    pub fn volume(&self, slot: usize, log_prior: Tensor<2>) -> Tensor<2> {
        let mut logits = self.base.val() + log_prior;
        if let Some(residual) = self.residuals.get(slot) {
            logits = logits + residual.val();
        }
        softmax(logits, 0)
    }
}
