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
