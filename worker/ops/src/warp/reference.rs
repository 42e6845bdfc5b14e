//! The warp in Burn's own tensor operations, which the tests compare the other forms with.

use super::{MIN_WEIGHT_SUM, WarpGrid};
use burn::tensor::{Int, Tensor};

/// See [`super::warp`].
pub fn warp(
    weights: Tensor<2>,
    transforms: Tensor<2>,
    points: Tensor<2>,
    grid: &WarpGrid,
) -> Tensor<2> {
    let [bones, _] = transforms.dims();
    let [n, _] = points.dims();
    let device = points.device();
    let [across, down, _] = grid.nodes.map(|count| count as i64);
    let transforms = transforms.reshape([bones, 3, 4]);
    let rotation = transforms.clone().slice([0..bones, 0..3, 0..3]);
    let shift = transforms.slice([0..bones, 0..3, 3..4]);
    // [K, 3, N]
    let carried = rotation.matmul(points.transpose().unsqueeze::<3>().repeat_dim(0, bones)) + shift;
    let min = Tensor::<1>::from_floats(grid.min, &device).reshape([1, 3, 1]);
    let scale = Tensor::<1>::from_floats(grid.scale(), &device).reshape([1, 3, 1]);
    let cell = (carried.clone() - min) * scale;
    let low = cell.clone().detach().floor();
    let part = cell - low.clone();
    let axis = |t: &Tensor<3>, a: usize| {
        t.clone()
            .slice([0..bones, a..a + 1, 0..n])
            .reshape([bones, n])
    };
    let mut sampled = Tensor::<2>::zeros([bones, n], &device);
    for corner in 0..8usize {
        let mut share = Tensor::<2>::ones([bones, n], &device);
        let mut inside = Tensor::<2>::ones([bones, n], &device);
        let mut index = Tensor::<2>::zeros([bones, n], &device);
        for (a, stride) in [(0, 1), (1, across), (2, across * down)] {
            let last = (grid.nodes[a] - 1) as f32;
            let high = corner >> a & 1 == 1;
            let t = axis(&part, a);
            share = share * if high { t } else { t.neg().add_scalar(1.0) };
            let node = axis(&low, a).add_scalar(if high { 1.0 } else { 0.0 });
            let valid = node.clone().greater_equal_scalar(0.0).float()
                * node.clone().lower_equal_scalar(last).float();
            inside = inside * valid;
            index = index + node.clamp(0.0, last).mul_scalar(stride as f32);
        }
        let index: Tensor<2, Int> = index.int();
        let value = weights.clone().narrow(0, 0, bones).gather(1, index);
        sampled = sampled + value * share * inside;
    }
    let sum = sampled.clone().sum_dim(0);
    let weighted = (carried * sampled.unsqueeze_dim::<3>(1))
        .sum_dim(0)
        .reshape([3, n]);
    let canonical = weighted / sum.clone().clamp_min(MIN_WEIGHT_SUM);
    Tensor::cat(vec![canonical, sum.clamp(0.0, 1.0)], 0).transpose()
}
