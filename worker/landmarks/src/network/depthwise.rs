//! Convolutions of each channel by itself.

use super::window::{Side, picture};
use super::{Made, Operation};
use crate::tflite::{Activation, Window};
use rayon::prelude::*;

/// Channels that are computed together, in the processor's wide registers.
const LANES: usize = 8;

#[derive(Debug)]
struct Depthwise {
    rows: Side,
    columns: Side,
    channels: usize,
    /// `[rows, columns, channels]`.
    weights: Vec<f32>,
    /// `[channels]`.
    bias: Vec<f32>,
    range: [f32; 2],
}

/// Most taps of a filter, all of which each output pixel reads. BlazePose's filters have 25.
const MAX_TAPS: usize = 1 << 10;

/// A convolution of each channel with its own part of the filter `[1, rows, columns, channels]`.
pub(super) fn depthwise(
    shape: &[usize],
    (filter, weights): (&[usize], &[f32]),
    bias: &[f32],
    window: Window,
    activation: Activation,
) -> Result<Made, String> {
    let [height, width, channels] = picture(shape)?;
    let [1, filter_rows, filter_columns, filter_channels] = *filter else {
        return Err(format!("{filter:?} is not the shape of a depthwise filter"));
    };
    if filter_channels != channels || bias.len() != channels {
        return Err(format!(
            "a filter of {filter:?} and {} biases for a picture of {shape:?}",
            bias.len()
        ));
    }
    if filter_rows.saturating_mul(filter_columns) > MAX_TAPS {
        return Err(format!(
            "a filter of {filter_rows}x{filter_columns} taps: {MAX_TAPS} are allowed"
        ));
    }
    let [rows, columns] = window.sides([height, width], [filter_rows, filter_columns])?;
    let made = Depthwise {
        rows,
        columns,
        channels,
        weights: weights.to_vec(),
        bias: bias.to_vec(),
        range: activation.range(),
    };
    let shape = vec![1, rows.output, columns.output, channels];
    Ok((Box::new(made), shape))
}

impl Depthwise {
    /// One output pixel. For each tap of the filter, `taps` has the indices of the first channel in the input and in the
    /// weights.
    fn pixel(&self, input: &[f32], taps: &[(usize, usize)], out: &mut [f32]) {
        let [low, high] = self.range;
        let (wide, rest) = out.as_chunks_mut::<LANES>();
        for (chunk, out) in wide.iter_mut().enumerate() {
            let at = chunk * LANES;
            let mut sum = lanes(&self.bias, at);
            for &(from, weights) in taps {
                let values = lanes(input, from + at);
                let weights = lanes(&self.weights, weights + at);
                for lane in 0..LANES {
                    sum[lane] += values[lane] * weights[lane];
                }
            }
            *out = sum.map(|value| value.max(low).min(high));
        }
        let done = self.channels - rest.len();
        for (at, out) in (done..).zip(rest) {
            let products = taps
                .iter()
                .map(|&(from, weights)| input[from + at] * self.weights[weights + at]);
            *out = (self.bias[at] + products.sum::<f32>()).max(low).min(high);
        }
    }
}

/// `LANES` numbers from `at` on.
#[inline(always)]
fn lanes(numbers: &[f32], at: usize) -> [f32; LANES] {
    numbers
        .get(at..at + LANES)
        .and_then(|numbers| numbers.first_chunk().copied())
        .unwrap_or_default()
}

impl Operation for Depthwise {
    fn run(&self, inputs: &[&[f32]], out: &mut [f32]) {
        let (input, channels) = (inputs[0], self.channels);
        let lines = out.par_chunks_exact_mut(self.columns.output * channels);
        lines
            .enumerate()
            .for_each_init(Vec::new, |taps, (y, line)| {
                for (x, out) in line.chunks_exact_mut(channels).enumerate() {
                    taps.clear();
                    for row in 0..self.rows.filter {
                        let Some(y) = self.rows.under(y, row) else {
                            continue;
                        };
                        for column in 0..self.columns.filter {
                            if let Some(x) = self.columns.under(x, column) {
                                let from = (y * self.columns.input + x) * channels;
                                taps.push((from, (row * self.columns.filter + column) * channels));
                            }
                        }
                    }
                    self.pixel(input, taps, out);
                }
            });
    }
}
