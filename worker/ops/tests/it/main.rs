//! Each operation against its reference in Burn's tensor operations: values and gradients, on
//! points inside its box, at the border and outside.

mod adam;
mod bone_softmax;
mod composite;
mod deconv;
mod extremes;
mod hash;
mod inverse;
mod picture_loss;
mod skin;
mod skin_surface;
mod splat;
mod splat_f64;
mod splat_slopes;
mod table;
mod warp;

use burn::tensor::{Device, Tensor, TensorData};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

fn numbers<const D: usize>(
    rng: &mut ChaCha8Rng,
    shape: [usize; D],
    low: f32,
    high: f32,
    device: &Device,
) -> Tensor<D> {
    let values: Vec<f32> = (0..shape.iter().product())
        .map(|_| rng.random_range(low..high))
        .collect();
    Tensor::from_data(TensorData::new(values, shape), device)
}

fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.try_into_vec_as().expect("f32")
}

/// Largest difference over the largest reference magnitude.
fn relative_error(ours: &[f32], reference: &[f32]) -> f32 {
    assert_eq!(ours.len(), reference.len());
    let largest = reference.iter().fold(0f32, |m, v| m.max(v.abs()));
    assert!(largest > 0.0, "a reference of zeros proves nothing");
    ours.iter()
        .zip(reference)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f32::max)
        / largest
}
