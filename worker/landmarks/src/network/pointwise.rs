//! Elementwise operations.

use super::{Made, Operation};
use crate::tflite::Activation;

#[derive(Debug)]
struct Add {
    range: [f32; 2],
}

/// The sum of two values with the same shape.
pub(super) fn add(a: &[usize], b: &[usize], activation: Activation) -> Result<Made, String> {
    if a != b {
        return Err(format!("{a:?} and {b:?} are added"));
    }
    let range = activation.range();
    Ok((Box::new(Add { range }), a.to_vec()))
}

impl Operation for Add {
    fn run(&self, inputs: &[&[f32]], out: &mut [f32]) {
        let [low, high] = self.range;
        for ((out, a), b) in out.iter_mut().zip(inputs[0]).zip(inputs[1]) {
            *out = (a + b).max(low).min(high);
        }
    }
}

#[derive(Debug)]
struct Logistic;

/// The logistic function.
pub(super) fn logistic(shape: &[usize]) -> Made {
    (Box::new(Logistic), shape.to_vec())
}

impl Operation for Logistic {
    fn run(&self, inputs: &[&[f32]], out: &mut [f32]) {
        for (out, value) in out.iter_mut().zip(inputs[0]) {
            *out = 1.0 / (1.0 + (-value).exp());
        }
    }
}

#[derive(Debug)]
struct Prelu {
    slopes: Vec<f32>,
}

/// `max(x, 0) + slope min(x, 0)`, with a slope for each channel.
pub(super) fn prelu(
    shape: &[usize],
    (slopes_shape, slopes): (&[usize], &[f32]),
) -> Result<Made, String> {
    let channels = shape.last().copied().unwrap_or(0);
    if channels == 0 || slopes.len() != channels || slopes_shape.last() != Some(&channels) {
        return Err(format!("slopes {slopes_shape:?} for values {shape:?}"));
    }
    let slopes = slopes.to_vec();
    Ok((Box::new(Prelu { slopes }), shape.to_vec()))
}

impl Operation for Prelu {
    fn run(&self, inputs: &[&[f32]], out: &mut [f32]) {
        let pixels = inputs[0].chunks_exact(self.slopes.len());
        for (out, pixel) in out.chunks_exact_mut(self.slopes.len()).zip(pixels) {
            for ((out, value), slope) in out.iter_mut().zip(pixel).zip(&self.slopes) {
                *out = value.max(0.0) + slope * value.min(0.0);
            }
        }
    }
}
