//! The transposed convolution on CPU threads, around the matrix products of the Flex backend, which
//! read transposed factors without a copy.
//!
//! The product of kernels and volume has the contribution of each input voxel through each kernel node to each
//! output channel. Folding (col2im) sums the contributions to each output voxel; unfolding (im2col) is its
//! transpose.

use super::{DeconvOps, KERNEL, NODES, PADDING, STRIDE};
use crate::flex::tensor;
use burn::backend::ops::FloatTensorOps;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Flex, TensorMetadata};
use burn::tensor::Shape;
use burn_flex::FlexTensor;
use rayon::prelude::*;
use std::ops::Range;

impl DeconvOps for Flex {
    fn deconv(volume: FloatTensor<Self>, kernels: FloatTensor<Self>) -> FloatTensor<Self> {
        let (side, volume) = flat(volume);
        let (channels, matrix) = matrix(kernels);
        let columns = product(matrix.transpose(0, 1), volume).to_contiguous();
        let output = fold(columns.storage(), side);
        let doubled = STRIDE * side;
        tensor(output, [channels, doubled, doubled, doubled])
    }

    fn deconv_backward(
        volume: FloatTensor<Self>,
        kernels: FloatTensor<Self>,
        grad: FloatTensor<Self>,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        let shapes = [volume.shape(), kernels.shape()];
        let (side, volume) = flat(volume);
        let (channels, matrix) = matrix(kernels);
        let columns = unfold(grad.to_contiguous().storage(), side);
        let columns = tensor(columns, [channels * NODES, side.pow(3)]);
        let to_volume = product(matrix, columns.clone());
        let to_kernels = product(volume, columns.transpose(0, 1));
        let [volume, kernels] = shapes;
        (to_volume.reshape(volume), to_kernels.reshape(kernels))
    }
}

fn product(left: FlexTensor, right: FlexTensor) -> FlexTensor {
    <Flex as FloatTensorOps<Flex>>::float_matmul(left, right)
}

/// Voxels per side of `volume`, and the volume as `[I, D³]`.
fn flat(volume: FlexTensor) -> (usize, FlexTensor) {
    let (channels, side) = (volume.shape()[0], volume.shape()[1]);
    let flat = volume
        .to_contiguous()
        .reshape(Shape::new([channels, side.pow(3)]));
    (side, flat)
}

/// Output channels of `kernels`, and the kernels as `[I, O · 4³]`.
fn matrix(kernels: FlexTensor) -> (usize, FlexTensor) {
    let (input, output) = (kernels.shape()[0], kernels.shape()[1]);
    let matrix = kernels
        .to_contiguous()
        .reshape(Shape::new([input, output * NODES]));
    (output, matrix)
}

/// The sums `[O, 2D, 2D, 2D]` of the contributions `columns` `[O, 4, 4, 4, D, D, D]`.
fn fold(columns: &[f32], side: usize) -> Vec<f32> {
    let (voxels, doubled) = (side.pow(3), STRIDE * side);
    let channels = columns.len() / (NODES * voxels);
    let mut output = vec![0f32; channels * doubled.pow(3)];
    output
        .par_chunks_mut(doubled.pow(3))
        .zip(columns.par_chunks(NODES * voxels))
        .for_each(|(output, columns)| {
            for (node, column) in columns.chunks_exact(voxels).enumerate() {
                let nodes = axes(node);
                each_row(nodes, side, |from, to| {
                    let (inputs, first) = contributing(nodes[2], side);
                    let outputs = output[to..to + doubled][first..].iter_mut().step_by(STRIDE);
                    for (output, value) in outputs.zip(&column[from..from + side][inputs]) {
                        *output += value;
                    }
                });
            }
        });
    output
}

/// The gradient `[O, 4, 4, 4, D, D, D]` to the contributions, from the gradient `output`
/// `[O, 2D, 2D, 2D]` to their sums.
fn unfold(output: &[f32], side: usize) -> Vec<f32> {
    let (voxels, doubled) = (side.pow(3), STRIDE * side);
    let channels = output.len() / doubled.pow(3);
    let mut columns = vec![0f32; channels * NODES * voxels];
    columns
        .par_chunks_mut(NODES * voxels)
        .zip(output.par_chunks(doubled.pow(3)))
        .for_each(|(columns, output)| {
            for (node, column) in columns.chunks_exact_mut(voxels).enumerate() {
                let nodes = axes(node);
                each_row(nodes, side, |from, to| {
                    let (inputs, first) = contributing(nodes[2], side);
                    let outputs = output[to..to + doubled][first..].iter().step_by(STRIDE);
                    for (value, output) in column[from..from + side][inputs].iter_mut().zip(outputs)
                    {
                        *value = *output;
                    }
                });
            }
        });
    columns
}

/// z, y, x of a kernel node.
fn axes(node: usize) -> [usize; 3] {
    [
        node / KERNEL / KERNEL,
        node / KERNEL % KERNEL,
        node % KERNEL,
    ]
}

/// The inputs along an axis of `side` that contribute through kernel node `node` to voxels inside
/// the output, and the first of these voxels.
fn contributing(node: usize, side: usize) -> (Range<usize>, usize) {
    // Input i contributes to 2i + node − 1, which must be in 0 .. 2·side.
    let first = usize::from(node < PADDING);
    let last = (STRIDE * side + PADDING - node).div_ceil(STRIDE).min(side);
    (first..last, STRIDE * first + node - PADDING)
}

/// Calls `work` for each row of input voxels along x that contributes to the output, with the start
/// of that row and of the output's row.
fn each_row(nodes: [usize; 3], side: usize, mut work: impl FnMut(usize, usize)) {
    let doubled = STRIDE * side;
    let (inputs, first_z) = contributing(nodes[0], side);
    for (to_z, z) in (first_z..).step_by(STRIDE).zip(inputs) {
        let (inputs, first_y) = contributing(nodes[1], side);
        for (to_y, y) in (first_y..).step_by(STRIDE).zip(inputs) {
            work((z * side + y) * side, (to_z * doubled + to_y) * doubled);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contributions_are_inside_the_output() {
        // With a single voxel, only the two middle nodes of the kernel contribute.
        let found: Vec<_> = (0..KERNEL).map(|node| contributing(node, 1)).collect();
        assert_eq!(found[1], (0..1, 0));
        assert_eq!(found[2], (0..1, 1));
        assert!(found[0].0.is_empty() && found[3].0.is_empty());
        // With three, the outer nodes lose one voxel each.
        let found: Vec<_> = (0..KERNEL).map(|node| contributing(node, 3)).collect();
        assert_eq!(found, [(1..3, 1), (0..3, 0), (0..3, 1), (0..2, 2)]);
    }
}
