//! Forward skinning of a surface in Burn's own tensor operations.

use super::super::skin::reference::bones_to_posed;
use super::{MIN_SUM, WarpGrid};
use burn::tensor::{Int, Tensor};

/// See [`super::skin_surface`].
pub fn skin_surface(
    factors: Tensor<2>,
    transforms: Tensor<2>,
    points: Tensor<2>,
    bones: Tensor<2>,
    weights: Tensor<2>,
    factored: usize,
    grid: &WarpGrid,
) -> Tensor<2> {
    let [n, width] = bones.dims();
    let weights = weights.detach();
    let bones = bones.int();
    let ([rows, voxels], [count, _]) = (factors.dims(), transforms.dims());
    assert!(
        factored <= rows,
        "factors of {factored} bones in {rows} rows"
    );
    let ones = Tensor::ones([count.saturating_sub(factored), voxels], &points.device());
    let factors = Tensor::cat(vec![factors.slice([0..factored, 0..voxels]), ones], 0);
    let weighted = weights.clone() * interpolated(factors, points, bones.clone(), grid);
    let sum = weighted.clone().sum_dim(1);
    let empty = sum.clone().greater_equal_scalar(MIN_SUM).bool_not();
    let normalized = weighted / sum.mask_fill(empty.clone(), 1.0);
    let normalized = normalized.mask_where(empty.repeat_dim(1, width), weights);
    let forward = bones_to_posed(transforms).select(0, bones.reshape([n * width]));
    (forward.reshape([n, width, 12]) * normalized.unsqueeze_dim::<3>(2))
        .sum_dim(1)
        .reshape([n, 12])
}

/// Factors `[N, B]` of the `bones` `[N, B]` at `points` `[N, 3]`; 1 outside the box.
fn interpolated(
    factors: Tensor<2>,
    points: Tensor<2>,
    bones: Tensor<2, Int>,
    grid: &WarpGrid,
) -> Tensor<2> {
    let ([n, width], [channels, voxels]) = (bones.dims(), factors.dims());
    let device = points.device();
    let row = |numbers: [f32; 3]| Tensor::<1>::from_floats(numbers, &device).unsqueeze::<2>();
    let place = (points - row(grid.min)) * row(grid.scale());
    let column = |t: &Tensor<2>, a: usize| t.clone().slice([0..n, a..a + 1]);
    let (mut low, mut part, mut inside) = (Vec::new(), Vec::new(), Tensor::ones([n, 1], &device));
    for (a, nodes) in grid.nodes.into_iter().enumerate() {
        let last = (nodes - 1) as f32;
        let at = column(&place, a);
        let still = at.clone().detach();
        inside = inside
            * still.clone().greater_equal_scalar(0.0).float()
            * still.clone().lower_equal_scalar(last).float();
        let lowest = still.floor().clamp(0.0, last - 1.0);
        part.push(at - lowest.clone());
        low.push(lowest);
    }
    let outside = inside.lower_scalar(0.5);
    let [across, down, _] = grid.nodes;
    let factors = factors.reshape([channels * voxels]);
    let volume = bones.mul_scalar(voxels as i64);
    let mut sampled = Tensor::<2>::zeros([n, width], &device);
    for corner in 0..8usize {
        let mut share = Tensor::<2>::ones([n, 1], &device);
        let mut node = Tensor::<2>::zeros([n, 1], &device);
        for (a, stride) in [1, across, across * down].into_iter().enumerate() {
            let high = corner >> a & 1 == 1;
            // No number of a point outside, which may be infinite, takes part.
            let part = part[a].clone().mask_fill(outside.clone(), 0.0);
            share = share * if high { part } else { part.neg() + 1.0 };
            let at = low[a].clone().mask_fill(outside.clone(), 0.0);
            node = node + at.add_scalar(if high { 1.0 } else { 0.0 }) * stride as f32;
        }
        let index = volume.clone() + node.int().repeat_dim(1, width);
        let value = factors.clone().select(0, index.reshape([n * width]));
        sampled = sampled + value.reshape([n, width]) * share;
    }
    sampled.mask_fill(outside.repeat_dim(1, width), 1.0)
}
