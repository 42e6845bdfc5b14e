//! The offsets in Burn's own tensor operations.

use burn::tensor::Tensor;

/// See [`super::blend_shapes`].
pub fn blend_shapes(near: Tensor<2>, by_joint: Tensor<2>, weights: Tensor<2>) -> Tensor<2> {
    let [n, count] = weights.dims();
    let moved = near.matmul(by_joint).reshape([n, 3, count]);
    let weights = weights.reshape([n, 1, count]);
    (moved * weights).sum_dim(2).reshape([n, 3])
}
