//! The softmax over bones in Burn's own tensor operations.

use burn::tensor::Tensor;
use burn::tensor::activation::softmax;

/// See [`super::bone_softmax`].
pub fn bone_softmax(logits: Tensor<2>, log_prior: Tensor<2>) -> Tensor<2> {
    softmax(logits + log_prior, 0)
}
