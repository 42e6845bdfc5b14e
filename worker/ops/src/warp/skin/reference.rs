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
    let first = bones_to_posed(transforms.clone().narrow(0, 0, 1)).repeat_dim(0, n);
    let blend = PosedBody::new(weights, transforms, grid).blend(points);
    let shift = blend.shift.reshape([n, 3, 1]);
    let blended = Tensor::cat(vec![blend.rotation, shift], 2).reshape([n, 12]);
    let empty = blend.empty.reshape([n, 1]).repeat_dim(1, 12);
    blended.mask_where(empty, first)
}

/// Canonical to posed `[K, 12]` of each bone, the inverses of the rigid `transforms` `[K, 12]`.
pub(in crate::warp) fn bones_to_posed(transforms: Tensor<2>) -> Tensor<2> {
    let [bones, _] = transforms.dims();
    let transforms = transforms.reshape([bones, 3, 4]);
    let rotations = transforms.clone().slice([0..bones, 0..3, 0..3]);
    let rotations = rotations.swap_dims(1, 2);
    let shifts = transforms.slice([0..bones, 0..3, 3..4]);
    let shifts = rotations.clone().matmul(shifts).neg();
    Tensor::cat(vec![rotations, shifts], 2).reshape([bones, 12])
}
