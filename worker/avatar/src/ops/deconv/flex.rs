//! The `cpu` form around the matrix products of the Flex backend, which read transposed factors
//! without a copy.

use super::{NODES, STRIDE, cpu};
use burn::backend::{Flex, TensorMetadata, ops::FloatTensorOps};
use burn::tensor::{Shape, TensorData};
use burn_flex::FlexTensor;

fn product(left: FlexTensor, right: FlexTensor) -> FlexTensor {
    <Flex as FloatTensorOps<Flex>>::float_matmul(left, right)
}

/// Voxels a side of `volume` and its form `[I, D³]`.
fn flat(volume: FlexTensor) -> (usize, FlexTensor) {
    let (channels, side) = (volume.shape()[0], volume.shape()[1]);
    let flat = volume
        .to_contiguous()
        .reshape(Shape::new([channels, side.pow(3)]));
    (side, flat)
}

/// Output channels of `kernels` and their form `[I, O · 4³]`.
fn matrix(kernels: FlexTensor) -> (usize, FlexTensor) {
    let (input, output) = (kernels.shape()[0], kernels.shape()[1]);
    let matrix = kernels
        .to_contiguous()
        .reshape(Shape::new([input, output * NODES]));
    (output, matrix)
}

/// See [`super::double`].
pub fn double(volume: FlexTensor, kernels: FlexTensor) -> FlexTensor {
    let (side, volume) = flat(volume);
    let (channels, matrix) = matrix(kernels);
    let columns = product(matrix.transpose(0, 1), volume).to_contiguous();
    let output = cpu::fold(columns.storage(), side);
    let doubled = STRIDE * side;
    FlexTensor::from_data(TensorData::new(
        output,
        [channels, doubled, doubled, doubled],
    ))
}

/// Gradients to the volume and the kernels, from `grad` `[O, 2D, 2D, 2D]`.
pub fn backward(
    volume: FlexTensor,
    kernels: FlexTensor,
    grad: FlexTensor,
) -> (FlexTensor, FlexTensor) {
    let shapes = [volume.shape(), kernels.shape()];
    let (side, volume) = flat(volume);
    let (channels, matrix) = matrix(kernels);
    let columns = cpu::unfold(grad.to_contiguous().storage(), side);
    let columns = FlexTensor::from_data(TensorData::new(columns, [channels * NODES, side.pow(3)]));
    let to_volume = product(matrix, columns.clone());
    let to_kernels = product(volume, columns.transpose(0, 1));
    let [volume, kernels] = shapes;
    (to_volume.reshape(volume), to_kernels.reshape(kernels))
}
