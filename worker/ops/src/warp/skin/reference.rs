//! Forward skinning in Burn's own tensor operations.

use super::super::inverse::reference::PosedBody;
use super::WarpGrid;
use burn::tensor::Tensor;

/// See [`super::skin`].
pub fn skin(
    weights: Tensor<2>,
    transforms: Tensor<2>,
    points: Tensor<2>,
    grid: &WarpGrid,
) -> Tensor<2> {
    let [n, _] = points.dims();
    let first = first_bone(transforms.clone().narrow(0, 0, 1)).repeat_dim(0, n);
    let blend = PosedBody::new(weights, transforms, grid).blend(points);
    let shift = blend.shift.reshape([n, 3, 1]);
    let blended = Tensor::cat(vec![blend.rotation, shift], 2).reshape([n, 12]);
    let empty = blend.empty.reshape([n, 1]).repeat_dim(1, 12);
    blended.mask_where(empty, first)
}

/// Canonical to posed `[1, 12]`, of the `transform` `[1, 12]` back.
fn first_bone(transform: Tensor<2>) -> Tensor<2> {
    let transform = transform.reshape([3, 4]);
    let rotation = transform.clone().slice([0..3, 0..3]).transpose();
    let shift = rotation.clone().matmul(transform.slice([0..3, 3..4])).neg();
    Tensor::cat(vec![rotation, shift], 1).reshape([1, 12])
}
