//! Convolutions over all channels, as matrix products.

use super::window::{Side, picture};
use super::{Made, Operation};
use crate::tflite::{Activation, Padding, Window};
use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use rayon::prelude::*;

/// Most output pixels per product, so that their numbers stay in the processor's caches.
const BLOCK: usize = 256;
/// Fewest output pixels per product, so that the weights are not read for a few pixels only.
const SMALLEST_BLOCK: usize = 32;
/// Most numbers in one filter of an output channel.
const MAX_DEPTH: usize = 1 << 16;

#[derive(Debug)]
struct Conv {
    rows: Side,
    columns: Side,
    channels_in: usize,
    channels_out: usize,
    /// `[rows · columns · channels_in, channels_out]`.
    weights: Vec<f32>,
    /// `[channels_out]`.
    bias: Vec<f32>,
    range: [f32; 2],
}

/// A convolution with the filter `[channels_out, rows, columns, channels_in]`.
pub(super) fn conv(
    shape: &[usize],
    (filter, weights): (&[usize], &[f32]),
    bias: &[f32],
    window: Window,
    activation: Activation,
) -> Result<Made, String> {
    let [height, width, channels_in] = picture(shape)?;
    let [channels_out, filter_rows, filter_columns, filter_in] = *filter else {
        return Err(format!("{filter:?} is not the shape of a filter"));
    };
    if filter_in != channels_in || bias.len() != channels_out || weights.is_empty() {
        return Err(format!(
            "a filter of {filter:?} and {} biases for a picture of {shape:?}",
            bias.len()
        ));
    }
    let [rows, columns] = window.sides([height, width], [filter_rows, filter_columns])?;
    let depth = weights.len() / channels_out;
    if depth > MAX_DEPTH {
        return Err(format!(
            "{depth} numbers under the filter: at most {MAX_DEPTH}"
        ));
    }
    let mut turned = vec![0.0; weights.len()];
    for (out, row) in weights.chunks_exact(depth).enumerate() {
        for (to, weight) in turned[out..].iter_mut().step_by(channels_out).zip(row) {
            *to = *weight;
        }
    }
    let made = Conv {
        rows,
        columns,
        channels_in,
        channels_out,
        weights: turned,
        bias: bias.to_vec(),
        range: activation.range(),
    };
    let shape = vec![1, rows.output, columns.output, channels_out];
    Ok((Box::new(made), shape))
}

/// The product of all numbers with `weights` `[outputs, inputs]`.
pub(super) fn fully_connected(
    shape: &[usize],
    (filter, weights): (&[usize], &[f32]),
    bias: &[f32],
    activation: Activation,
) -> Result<Made, String> {
    let [outputs, inputs] = *filter else {
        return Err(format!("{filter:?} is not the shape of a matrix"));
    };
    let one = Window {
        padding: Padding::Valid,
        stride: [1; 2],
        dilation: [1; 2],
    };
    let numbers = [1, 1, 1, shape.iter().product()];
    let filter = [outputs, 1, 1, inputs];
    let (made, _) = conv(&numbers, (&filter, weights), bias, one, activation)?;
    Ok((made, vec![1, outputs]))
}

impl Conv {
    /// Whether each output pixel reads only the input pixel at the same position.
    fn is_pointwise(&self) -> bool {
        let plain = |side: &Side| side.filter == 1 && side.stride == 1;
        plain(&self.rows) && plain(&self.columns)
    }

    /// The input's numbers under the filter, `[pixels, depth]`, for the output pixels from `first` on; zeros in the
    /// padding.
    fn patches(&self, input: &[f32], first: usize, pixels: usize) -> Vec<f32> {
        let channels = self.channels_in;
        let mut patches = vec![0.0; pixels * (self.weights.len() / self.channels_out)];
        let mut slots = patches.chunks_exact_mut(channels);
        for pixel in first..first + pixels {
            let (y, x) = (pixel / self.columns.output, pixel % self.columns.output);
            for row in (0..self.rows.filter).map(|tap| self.rows.under(y, tap)) {
                for column in (0..self.columns.filter).map(|tap| self.columns.under(x, tap)) {
                    let slot = slots.next();
                    if let (Some(row), Some(column), Some(slot)) = (row, column, slot) {
                        let from = (row * self.columns.input + column) * channels;
                        slot.copy_from_slice(&input[from..from + channels]);
                    }
                }
            }
        }
        patches
    }
}

impl Operation for Conv {
    fn run(&self, inputs: &[&[f32]], out: &mut [f32]) {
        let (input, channels) = (inputs[0], self.channels_out);
        let depth = self.weights.len() / channels;
        let weights = MatRef::from_row_major_slice(&self.weights, depth, channels);
        let pixels = self.rows.output * self.columns.output;
        let share = pixels.div_ceil(rayon::current_num_threads());
        let block = share.clamp(SMALLEST_BLOCK, BLOCK);
        let [low, high] = self.range;
        let blocks = out.par_chunks_mut(block * channels).enumerate();
        blocks.for_each(|(at, out)| {
            let (first, pixels) = (at * block, out.len() / channels);
            for pixel in out.chunks_exact_mut(channels) {
                pixel.copy_from_slice(&self.bias);
            }
            let patches;
            let from = if self.is_pointwise() {
                &input[first * depth..(first + pixels) * depth]
            } else {
                patches = self.patches(input, first, pixels);
                &patches[..]
            };
            matmul(
                MatMut::from_row_major_slice_mut(&mut *out, pixels, channels),
                Accum::Add,
                MatRef::from_row_major_slice(from, pixels, depth),
                weights,
                1.0,
                Par::Seq,
            );
            for value in out {
                *value = value.clamp(low, high);
            }
        });
    }
}
