//! Pose correction (HumanNeRF): a network learns the errors of estimated poses.

use super::rotation::rodrigues;
use crate::config::{CorrectionConfig, Precision};
use crate::field::mlp::{Mlp, MlpShape};
use crate::init::Initial;
use burn::module::Module;
use burn::tensor::Tensor;
use yoto_ops::mlp::Input;

/// Initial output weights are uniform in ± this, so that corrections start near 0 (HumanNeRF).
const OUTPUT_BOUND: f64 = 1e-5;

/// Rotations that follow those of a pose; the root has none.
#[derive(Module, Debug)]
pub struct PoseCorrection {
    mlp: Mlp,
}

impl PoseCorrection {
    pub(crate) fn new(init: &Initial, config: &CorrectionConfig, joints: usize) -> Self {
        let width = 3 * (joints - 1);
        let shape = MlpShape {
            path: "correction",
            input: width,
            width: config.width,
            depth: config.depth,
            skip: None,
            codes: &[],
            output: width,
            output_bound: Some(OUTPUT_BOUND),
            precision: Precision::F32,
        };
        Self {
            mlp: Mlp::new(init, &shape),
        }
    }

    /// Pose vector `[3 (K − 1)]` → ΔR `[K − 1, 3, 3]`.
    pub fn forward(&self, pose: Tensor<1>) -> Tensor<3> {
        rodrigues(self.vectors(pose))
    }

    /// Pose vector `[3 (K − 1)]` → axis-angle vectors of the corrections `[K − 1, 3]`, radians.
    pub fn vectors(&self, pose: Tensor<1>) -> Tensor<2> {
        let [width] = pose.dims();
        self.mlp
            .forward(pose.unsqueeze::<2>(), Input::Features { width }, &[])
            .reshape([width / 3, 3])
    }
}
