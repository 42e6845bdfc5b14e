//! Compositing on a GPU: a thread per ray walks it front to back, and for gradients back again, with the
//! equations of `cpu`.

use super::{CompositeOps, OPAQUE, RaySamples};
use crate::cube::tensors::{each, empty, rows, upload, zeros};
use burn::backend::tensor::FloatTensor;
use burn::tensor::Shape;
use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;

impl CompositeOps for CubeBackend {
    fn composite(
        rgb: FloatTensor<Self>,
        density: FloatTensor<Self>,
        likelihood: FloatTensor<Self>,
        samples: RaySamples,
    ) -> FloatTensor<Self> {
        forward(rgb, density, likelihood, &samples)
    }

    fn composite_backward(
        rgb: FloatTensor<Self>,
        density: FloatTensor<Self>,
        likelihood: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        samples: RaySamples,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        backward(rgb, density, likelihood, grad, &samples)
    }
}

/// `[R, 5]` as in [`super::composite`].
fn forward(
    rgb: CubeTensor,
    density: CubeTensor,
    likelihood: CubeTensor,
    samples: &RaySamples,
) -> CubeTensor {
    let (rgb, density, likelihood) = (rows(rgb), rows(density), rows(likelihood));
    if samples.steps.is_empty() {
        return zeros(&rgb, super::output_shape(samples));
    }
    let output = empty(&rgb, super::output_shape(samples));
    let client = output.client.clone();
    if samples.rays() > 0 {
        let (count, dim) = each(&client, samples.rays());
        composite_ray::launch(
            &client,
            count,
            dim,
            rgb.into_buffer_arg(),
            density.into_buffer_arg(),
            likelihood.into_buffer_arg(),
            upload(&client, &starts(samples)),
            upload(&client, &steps_and_depths(samples)),
            output.clone().into_buffer_arg(),
            samples.min_transmittance,
        );
    }
    output
}

/// Gradients to rgb `[n, 3]`, density `[n]` and likelihood `[n]`, from `grad` `[R, 5]`.
fn backward(
    rgb: CubeTensor,
    density: CubeTensor,
    likelihood: CubeTensor,
    grad: CubeTensor,
    samples: &RaySamples,
) -> (CubeTensor, CubeTensor, CubeTensor) {
    let (rgb, density) = (rows(rgb), rows(density));
    let (likelihood, grad) = (rows(likelihood), rows(grad));
    let n = samples.steps.len();
    let to_rgb = empty(&rgb, Shape::new([n, 3]));
    let to_density = empty(&rgb, Shape::new([n]));
    let to_likelihood = empty(&rgb, Shape::new([n]));
    let client = rgb.client.clone();
    if samples.rays() > 0 && n > 0 {
        let (count, dim) = each(&client, samples.rays());
        composite_ray_backward::launch(
            &client,
            count,
            dim,
            rgb.into_buffer_arg(),
            density.into_buffer_arg(),
            likelihood.into_buffer_arg(),
            upload(&client, &starts(samples)),
            upload(&client, &steps_and_depths(samples)),
            grad.into_buffer_arg(),
            to_rgb.clone().into_buffer_arg(),
            to_density.clone().into_buffer_arg(),
            to_likelihood.clone().into_buffer_arg(),
            samples.min_transmittance,
        );
    }
    (to_rgb, to_density, to_likelihood)
}

fn starts(samples: &RaySamples) -> Vec<u32> {
    samples.starts.iter().map(|start| *start as u32).collect()
}

/// `[n, 2]` in one buffer: some drivers bind at most ten.
fn steps_and_depths(samples: &RaySamples) -> Vec<f32> {
    let pairs = samples.steps.iter().zip(samples.depths.iter());
    pairs.flat_map(|(step, depth)| [*step, *depth]).collect()
}

/// Share of the light that passes a sample of opacity `alpha`, 1 − α + 1e-10. The sums must be in this
/// order: 1 + 1e-10 is 1 in f32.
#[cube]
fn transmitted(alpha: f32) -> f32 {
    (1.0 - alpha) + OPAQUE
}

/// Writes `[R, 5]` as the operation `composite` does. `lengths` `[n, 2]` are steps and depths.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
fn composite_ray(
    rgb: &[f32],
    density: &[f32],
    likelihood: &[f32],
    starts: &[u32],
    lengths: &[f32],
    output: &mut [f32],
    min_transmittance: f32,
) {
    let ray = ABSOLUTE_POS;
    if ray >= starts.len() - 1 {
        terminate!();
    }
    let end = starts[ray + 1] as usize;
    let mut i = starts[ray] as usize;
    let mut transmittance = 1.0f32;
    let mut red = 0.0f32;
    let mut green = 0.0f32;
    let mut blue = 0.0f32;
    let mut opacity = 0.0f32;
    let mut depth = 0.0f32;
    while i < end {
        // α = (1 − exp(−σ δ)) m, C += T α c, T ← T (1 − α) (YOTO, eq. 9)
        let alpha = (1.0 - f32::exp(-density[i] * lengths[2 * i])) * likelihood[i];
        let weight = transmittance * alpha;
        red += weight * rgb[3 * i];
        green += weight * rgb[3 * i + 1];
        blue += weight * rgb[3 * i + 2];
        opacity += weight;
        depth += weight * lengths[2 * i + 1];
        transmittance *= transmitted(alpha);
        i += 1;
        if transmittance < min_transmittance {
            i = end;
        }
    }
    output[5 * ray] = red;
    output[5 * ray + 1] = green;
    output[5 * ray + 2] = blue;
    output[5 * ray + 3] = opacity;
    output[5 * ray + 4] = depth;
}

/// Writes the gradients to the inputs of `composite_ray`, from `grad` `[R, 5]`.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
fn composite_ray_backward(
    rgb: &[f32],
    density: &[f32],
    likelihood: &[f32],
    starts: &[u32],
    lengths: &[f32],
    grad: &[f32],
    to_rgb: &mut [f32],
    to_density: &mut [f32],
    to_likelihood: &mut [f32],
    min_transmittance: f32,
) {
    let ray = ABSOLUTE_POS;
    if ray >= starts.len() - 1 {
        terminate!();
    }
    let start = starts[ray] as usize;
    let end = starts[ray + 1] as usize;
    let red = grad[5 * ray];
    let green = grad[5 * ray + 1];
    let blue = grad[5 * ray + 2];
    let to_opacity = grad[5 * ray + 3];
    let to_depth = grad[5 * ray + 4];

    // Front to back. The transmittance before a sample is kept in the gradient to its density.
    let mut transmittance = 1.0f32;
    let mut stop = start;
    let mut visible = true;
    for i in start..end {
        to_density[i] = transmittance;
        if visible {
            stop = i + 1;
            let alpha = (1.0 - f32::exp(-density[i] * lengths[2 * i])) * likelihood[i];
            transmittance *= transmitted(alpha);
            if transmittance < min_transmittance {
                visible = false;
            }
        } else {
            to_rgb[3 * i] = 0.0;
            to_rgb[3 * i + 1] = 0.0;
            to_rgb[3 * i + 2] = 0.0;
            to_density[i] = 0.0;
            to_likelihood[i] = 0.0;
        }
    }

    // Back to front, with the value B that the samples behind would add per unit of light.
    let mut behind = 0.0f32;
    for k in 0..stop - start {
        let i = stop - 1 - k;
        let before = to_density[i];
        let passed = f32::exp(-density[i] * lengths[2 * i]);
        let alpha = (1.0 - passed) * likelihood[i];
        let value = red * rgb[3 * i]
            + green * rgb[3 * i + 1]
            + blue * rgb[3 * i + 2]
            + to_opacity
            + to_depth * lengths[2 * i + 1];
        // ∂L/∂α = T (v − B), ∂L/∂c = T α ∂L/∂C
        let to_alpha = before * (value - behind);
        let weight = before * alpha;
        to_rgb[3 * i] = red * weight;
        to_rgb[3 * i + 1] = green * weight;
        to_rgb[3 * i + 2] = blue * weight;
        // ∂α/∂σ = m δ exp(−σ δ), ∂α/∂m = 1 − exp(−σ δ)
        to_density[i] = to_alpha * likelihood[i] * lengths[2 * i] * passed;
        to_likelihood[i] = to_alpha * (1.0 - passed);
        // B ← α v + (1 − α) B
        behind = alpha * value + transmitted(alpha) * behind;
    }
}
