//! Unwraps the Flex backend's tensors into slices for the `cpu` forms.

use super::{AvatarOps, CpuOps, adam, composite, deconv, hash, mlp, warp};
use burn::backend::{Flex, TensorMetadata, tensor::FloatTensor};
use burn::tensor::TensorData;
use burn_flex::FlexTensor;

fn tensor<const D: usize>(values: Vec<f32>, shape: [usize; D]) -> FlexTensor {
    FlexTensor::from_data(TensorData::new(values, shape))
}

/// The tensor with its numbers in order. The given handle on them goes: while two are held, a
/// write copies them all first.
fn contiguous(tensor: FlexTensor) -> FlexTensor {
    tensor.to_contiguous()
}

impl AvatarOps for Flex {
    fn warp(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grid: warp::WarpGrid,
    ) -> FloatTensor<Self> {
        let rows = points.shape()[0];
        let (weights, transforms, points) = (
            weights.to_contiguous(),
            transforms.to_contiguous(),
            points.to_contiguous(),
        );
        let output = warp::cpu::forward(
            weights.storage(),
            transforms.storage(),
            points.storage(),
            &grid,
        );
        tensor(output, [rows, 4])
    }

    fn warp_backward(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        grid: warp::WarpGrid,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        let (weights, transforms) = (weights.to_contiguous(), transforms.to_contiguous());
        let (points, grad) = (points.to_contiguous(), grad.to_contiguous());
        let (rows, bones) = (weights.shape()[0], transforms.shape()[0]);
        let voxels = weights.shape()[1];
        let (to_weights, to_transforms) = warp::cpu::backward(
            weights.storage(),
            transforms.storage(),
            points.storage(),
            grad.storage(),
            &grid,
        );
        (
            tensor(to_weights, [rows, voxels]),
            tensor(to_transforms, [bones, 12]),
        )
    }

    fn composite(
        rgb: FloatTensor<Self>,
        density: FloatTensor<Self>,
        likelihood: FloatTensor<Self>,
        samples: composite::RaySamples,
    ) -> FloatTensor<Self> {
        composite::flex(rgb, density, likelihood, &samples)
    }

    fn composite_backward(
        rgb: FloatTensor<Self>,
        density: FloatTensor<Self>,
        likelihood: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        samples: composite::RaySamples,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        composite::flex_backward(rgb, density, likelihood, grad, &samples)
    }

    fn hash_encode(
        table: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grid: hash::HashGrid,
    ) -> FloatTensor<Self> {
        let rows = points.shape()[0];
        let (table, points) = (table.to_contiguous(), points.to_contiguous());
        let output = hash::cpu::forward(table.storage(), points.storage(), &grid);
        tensor(output, [rows, grid.width()])
    }

    fn hash_encode_backward(
        table: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        grid: hash::HashGrid,
        points_too: bool,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        let (entries, rows) = (table.shape()[0], points.shape()[0]);
        let (table, points, grad) = (
            table.to_contiguous(),
            points.to_contiguous(),
            grad.to_contiguous(),
        );
        let (to_table, to_points) = hash::cpu::backward(
            table.storage(),
            points.storage(),
            grad.storage(),
            &grid,
            points_too,
        );
        (
            tensor(to_table, [entries, grid.features]),
            tensor(to_points, [if points_too { rows } else { 0 }, 3]),
        )
    }

    fn adam_update(
        param: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        moment_1: FloatTensor<Self>,
        moment_2: FloatTensor<Self>,
        rates: adam::AdamRates,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        let grad = grad.to_contiguous();
        let [mut param, mut moment_1, mut moment_2] = [param, moment_1, moment_2].map(contiguous);
        // `storage_mut` copies first when another tensor still shares the memory.
        adam::cpu::update(
            param.storage_mut(),
            grad.storage(),
            moment_1.storage_mut(),
            moment_2.storage_mut(),
            rates,
        );
        (param, moment_1, moment_2)
    }
}

impl CpuOps for Flex {
    fn mlp(
        params: FloatTensor<Self>,
        input: FloatTensor<Self>,
        plan: mlp::MlpPlan,
    ) -> FloatTensor<Self> {
        mlp::flex::mlp(params, input, &plan)
    }

    fn mlp_backward(
        params: FloatTensor<Self>,
        input: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        plan: mlp::MlpPlan,
        to_input: bool,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        mlp::flex::mlp_backward(params, input, grad, &plan, to_input)
    }

    fn deconv(volume: FloatTensor<Self>, kernels: FloatTensor<Self>) -> FloatTensor<Self> {
        deconv::flex::double(volume, kernels)
    }

    fn deconv_backward(
        volume: FloatTensor<Self>,
        kernels: FloatTensor<Self>,
        grad: FloatTensor<Self>,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        deconv::flex::backward(volume, kernels, grad)
    }
}
