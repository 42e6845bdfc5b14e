//! The pose-conditioned code (paper eq. 3 to 5): attention of the identity's code to the posed
//! joints. P_nr = softmax(S^q (P^k)ᵀ) P^v; F_nr = P_nr + S_i.

use crate::config::ConditionConfig;
use crate::init::Initial;
use burn::module::{Module, Param};
use burn::tensor::Tensor;
use burn::tensor::activation::softmax;
use std::f32::consts::PI;
use yoto_ops::encode::{Bands, frequencies};

/// Cross-attention between an identity code and the joints of a frame.
#[derive(Module, Debug)]
pub struct PoseCondition {
    /// `[6 bands, d]`: W_p.
    joints: Param<Tensor<2>>,
    /// `[d, d]`: W_Q.
    query: Param<Tensor<2>>,
    /// `[d, d]`: W_K.
    key: Param<Tensor<2>>,
    /// `[d, d]`: W_V.
    value: Param<Tensor<2>>,
}

impl PoseCondition {
    pub(crate) fn new(init: &Initial, config: &ConditionConfig, width: usize) -> Self {
        let xavier = |path: &str, rows: usize| {
            init.uniform(path, [rows, width], (6.0 / (rows + width) as f64).sqrt())
        };
        Self {
            joints: xavier("condition.joints", 6 * config.bands),
            query: xavier("condition.query", width),
            key: xavier("condition.key", width),
            value: xavier("condition.value", width),
        }
    }

    /// F_nr `[d]` of the identity `code` `[d]` in the pose with `joints` `[K − 1, 3]` relative to
    /// the root, metres.
    pub fn forward(
        &self,
        config: &ConditionConfig,
        code: Tensor<1>,
        joints: Tensor<2>,
    ) -> Tensor<1> {
        let encoded = frequencies(joints, &Bands::new(config.bands, PI));
        let features = encoded.matmul(self.joints.val());
        let query = code.clone().unsqueeze::<2>().matmul(self.query.val());
        let [_, width] = query.dims();
        let scores = query.matmul(features.clone().matmul(self.key.val()).transpose());
        let answer = softmax(scores, 1).matmul(features.matmul(self.value.val()));
        answer.reshape([width]) + code
    }
}
