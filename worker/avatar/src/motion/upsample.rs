//! Trilinear interpolation of a volume at the nodes of a finer grid over the same box.

use crate::config::Resolution;
use burn::tensor::{Device, Tensor, TensorData};

/// Channels on the nodes of a grid of another resolution: `[C, V]` becomes `[C, W]`, nodes at both ends of each axis, x fastest.
/// Interpolation is a linear map along each axis, so that its gradient is exact.
pub(super) fn upsampled(volume: Tensor<2>, from: Resolution, to: Resolution) -> Tensor<2> {
    if from == to {
        return volume;
    }
    let device = volume.device();
    let [channels, _] = volume.dims();
    let [x, y, z] = from.nodes();
    let [across, down, deep] = to.nodes();
    let volume = volume.reshape([channels * z * y, x]);
    let volume = volume.matmul(axis(x, across, &device).transpose());
    let volume = volume.reshape([channels * z, y, across]);
    let volume = axis(y, down, &device).unsqueeze::<3>().matmul(volume);
    let volume = volume.reshape([channels, z, down * across]);
    let volume = axis(z, deep, &device).unsqueeze::<3>().matmul(volume);
    volume.reshape([channels, deep * down * across])
}

/// `[to, from]`: the shares of the nodes of an axis in those of another over the same length.
fn axis(from: usize, to: usize, device: &Device) -> Tensor<2> {
    let mut shares = vec![0f32; to * from];
    for node in 0..to {
        let at = node as f64 * (from - 1) as f64 / (to - 1) as f64;
        let below = (at as usize).min(from - 2);
        let share = at - below as f64;
        shares[node * from + below] = (1.0 - share) as f32;
        shares[node * from + below + 1] = share as f32;
    }
    Tensor::from_data(TensorData::new(shares, [to, from]), device)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::read;

    const FINE: Resolution = Resolution::Axes([4, 7, 5]);
    const COARSE: Resolution = Resolution::Axes([2, 3, 4]);

    /// Two channels of linear functions of the place in the unit box at the nodes of a grid.
    fn linear(resolution: Resolution) -> Vec<f32> {
        let [x, y, z] = resolution.nodes();
        let at = |index: usize, of: usize| index as f32 / (of - 1) as f32;
        let values = |[a, b, c]: [f32; 3]| {
            let node = move |i: usize| (at(i % x, x), at(i / x % y, y), at(i / (x * y), z));
            (0..resolution.voxels()).map(move |i| {
                let (x, y, z) = node(i);
                1.0 + a * x + b * y + c * z
            })
        };
        values([1.0, 2.0, 4.0])
            .chain(values([-3.0, 0.5, 0.0]))
            .collect()
    }

    fn volume(resolution: Resolution) -> Tensor<2> {
        let data = TensorData::new(linear(resolution), [2, resolution.voxels()]);
        Tensor::from_data(data, &Device::flex())
    }

    #[test]
    fn linear_functions_are_kept() {
        for (from, to) in [(COARSE, FINE), (FINE, COARSE)] {
            let values = read(upsampled(volume(from), from, to)).expect("host values");
            for (value, expected) in values.iter().zip(linear(to)) {
                assert!((value - expected).abs() < 1e-5, "{value} for {expected}");
            }
            assert_eq!(values.len(), 2 * to.voxels());
        }
    }

    #[test]
    fn a_node_between_two_is_their_mean_and_has_the_same_part_in_gradients() {
        let (from, to) = (Resolution::Axes([2, 2, 2]), Resolution::Axes([3, 2, 2]));
        let data = TensorData::new((0..8).map(|i| (i * i) as f32).collect(), [1, 8]);
        let volume = Tensor::<2>::from_data(data, &Device::flex().autodiff()).require_grad();
        let fine = upsampled(volume.clone(), from, to);
        let row = read(fine.clone().slice([0..1, 0..3]).inner()).expect("host values");
        assert_eq!(row, [0.0, 0.5, 1.0]);
        let grads = fine.slice([0..1, 1..2]).sum().backward();
        let grad = volume.grad(&grads).expect("a gradient");
        let grad = read(grad).expect("host values");
        assert_eq!(grad, [0.5, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    }
}
