//! Comparison of numbers computed on two devices.

use burn::tensor::{Device, Tensor, TensorData};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Values in host memory, drawn once for all devices.
#[derive(Clone)]
pub(crate) struct Numbers<const D: usize> {
    values: Vec<f32>,
    shape: [usize; D],
}

impl<const D: usize> Numbers<D> {
    pub(crate) fn drawn(rng: &mut ChaCha8Rng, shape: [usize; D], low: f32, high: f32) -> Self {
        let count = shape.iter().product();
        Self {
            values: (0..count).map(|_| rng.random_range(low..high)).collect(),
            shape,
        }
    }

    /// These values after `change`.
    pub(crate) fn with(mut self, change: impl FnOnce(&mut [f32])) -> Self {
        change(&mut self.values);
        self
    }

    pub(crate) fn on(&self, device: &Device) -> Tensor<D> {
        Tensor::from_data(TensorData::new(self.values.clone(), self.shape), device)
    }

    /// The same, tracked as a parameter.
    pub(crate) fn learned_on(&self, device: &Device) -> Tensor<D> {
        self.on(device).require_grad()
    }
}

pub(crate) fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.try_into_vec_as().expect("f32")
}

/// Largest difference, relative to the largest reference magnitude.
pub(crate) fn relative_error(ours: &[f32], reference: &[f32]) -> f32 {
    assert_eq!(ours.len(), reference.len());
    let largest = reference.iter().fold(0f32, |m, v| m.max(v.abs()));
    assert!(largest > 0.0, "a reference of zeros proves nothing");
    let differences = ours.iter().zip(reference).map(|(a, b)| (a - b).abs());
    // A NaN must not hide behind `max`.
    differences.fold(0.0, |m, d| if d > m || d.is_nan() { d } else { m }) / largest
}

/// Asserts that `ours` differs from the reference by at most `bound`; failures name the part.
pub(crate) fn assert_close(parts: &[&str], ours: &[Vec<f32>], reference: &[Vec<f32>], bound: f32) {
    assert_eq!((parts.len(), parts.len()), (ours.len(), reference.len()));
    let mut far = Vec::new();
    for ((part, a), b) in parts.iter().zip(ours).zip(reference) {
        let error = relative_error(a, b);
        println!("{part}: {error:e}");
        if error >= bound || error.is_nan() {
            far.push(part);
        }
    }
    assert!(far.is_empty(), "too far from the reference: {far:?}");
}
