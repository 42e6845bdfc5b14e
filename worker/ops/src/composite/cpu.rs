//! Compositing on CPU threads, ray by ray.
//!
//! The backward pass needs no division by 1 − α, which can be 0. With v the inner product of the output's gradient
//! and a sample's (colour, 1, depth), L = Σ T α v. From far to near, the backward pass keeps the value B that the
//! samples behind would add per unit of light, B ← α v + (1 − α) B; the gradient to a sample's α is T (v − B).

use super::accumulator::{RayAccumulator, opacity, transmitted};
use super::{CompositeOps, RaySamples};
use crate::flex::tensor;
use burn::backend::Flex;
use burn::backend::tensor::FloatTensor;
use rayon::prelude::*;

/// Rays per task: enough that starting tasks takes no noticeable time.
const BLOCK: usize = 128;

impl CompositeOps for Flex {
    fn composite(
        rgb: FloatTensor<Self>,
        density: FloatTensor<Self>,
        likelihood: FloatTensor<Self>,
        samples: RaySamples,
    ) -> FloatTensor<Self> {
        let [rgb, density, likelihood] =
            [rgb, density, likelihood].map(|tensor| tensor.to_contiguous());
        let output = forward(
            rgb.storage(),
            density.storage(),
            likelihood.storage(),
            &samples,
        );
        tensor(output, [samples.rays(), 5])
    }

    fn composite_backward(
        rgb: FloatTensor<Self>,
        density: FloatTensor<Self>,
        likelihood: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        samples: RaySamples,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        let [rgb, density, likelihood, grad] =
            [rgb, density, likelihood, grad].map(|tensor| tensor.to_contiguous());
        let to = backward(
            rgb.storage(),
            density.storage(),
            likelihood.storage(),
            grad.storage(),
            &samples,
        );
        let n = to.density.len();
        (
            tensor(to.rgb, [n, 3]),
            tensor(to.density, [n]),
            tensor(to.likelihood, [n]),
        )
    }
}

/// Checks that there are values for all samples.
///
/// # Panics
/// If not.
fn check(rgb: &[f32], density: &[f32], likelihood: &[f32], samples: &RaySamples) {
    let n = samples.starts[samples.rays()];
    let lengths = [
        density.len(),
        likelihood.len(),
        samples.steps.len(),
        samples.depths.len(),
    ];
    assert!(
        rgb.len() == 3 * n && lengths == [n; 4],
        "{n} samples of rays, but {} numbers of colours and {lengths:?} densities, likelihoods, \
         steps and depths",
        rgb.len()
    );
}

/// `[R, 5]` as in [`super::composite`].
///
/// # Panics
/// If the numbers of samples differ.
pub fn forward(rgb: &[f32], density: &[f32], likelihood: &[f32], samples: &RaySamples) -> Vec<f32> {
    check(rgb, density, likelihood, samples);
    let mut output = vec![0f32; samples.rays() * 5];
    output
        .par_chunks_mut(5 * BLOCK)
        .zip(samples.starts.par_windows(2).chunks(BLOCK))
        .for_each(|(output, rays)| {
            for (out, ray) in output.chunks_exact_mut(5).zip(rays) {
                let mut sums = RayAccumulator::START;
                for i in ray[0]..ray[1] {
                    if sums.transmittance < samples.min_transmittance {
                        break;
                    }
                    let alpha = opacity(density[i], samples.steps[i], likelihood[i]);
                    sums.add(&rgb[3 * i..3 * i + 3], alpha, samples.depths[i]);
                }
                out[..3].copy_from_slice(&sums.rgb);
                out[3] = sums.alpha;
                out[4] = sums.depth;
            }
        });
    output
}

/// Gradients to the inputs of [`forward`].
pub struct Gradients {
    /// `[n, 3]`.
    pub rgb: Vec<f32>,
    /// `[n]`.
    pub density: Vec<f32>,
    /// `[n]`.
    pub likelihood: Vec<f32>,
}

/// Gradients of [`forward`] from `grad` `[R, 5]`.
///
/// # Panics
/// If the numbers of samples or rays differ.
pub fn backward(
    rgb: &[f32],
    density: &[f32],
    likelihood: &[f32],
    grad: &[f32],
    samples: &RaySamples,
) -> Gradients {
    check(rgb, density, likelihood, samples);
    assert_eq!(grad.len(), 5 * samples.rays(), "numbers of the gradient");
    let n = density.len();
    let mut to = Gradients {
        rgb: vec![0f32; 3 * n],
        density: vec![0f32; n],
        likelihood: vec![0f32; n],
    };
    // Each block of rays owns the samples of its rays.
    let mut blocks = Vec::with_capacity(samples.rays() / BLOCK + 1);
    let (mut to_rgb, mut to_density, mut to_likelihood) = (
        to.rgb.as_mut_slice(),
        to.density.as_mut_slice(),
        to.likelihood.as_mut_slice(),
    );
    for first in (0..samples.rays()).step_by(BLOCK) {
        let last = (first + BLOCK).min(samples.rays());
        let count = samples.starts[last] - samples.starts[first];
        let (a, b, c);
        (a, to_rgb) = to_rgb.split_at_mut(3 * count);
        (b, to_density) = to_density.split_at_mut(count);
        (c, to_likelihood) = to_likelihood.split_at_mut(count);
        blocks.push((first..last, a, b, c));
    }
    blocks
        .into_par_iter()
        .for_each(|(rays, to_rgb, to_density, to_likelihood)| {
            let offset = samples.starts[rays.start];
            // Transmittance T before each sample, and exp(−σ δ).
            let mut steps: Vec<[f32; 2]> = Vec::new();
            for ray in rays {
                let (start, end) = (samples.starts[ray], samples.starts[ray + 1]);
                let g = &grad[5 * ray..5 * ray + 5];
                steps.clear();
                let mut transmittance = 1f32;
                for i in start..end {
                    if transmittance < samples.min_transmittance {
                        break;
                    }
                    let passed = (-density[i] * samples.steps[i]).exp();
                    steps.push([transmittance, passed]);
                    transmittance *= transmitted((1.0 - passed) * likelihood[i]);
                }
                let mut behind = 0f32;
                for (i, [transmittance, passed]) in (start..start + steps.len()).zip(&steps).rev() {
                    let alpha = (1.0 - passed) * likelihood[i];
                    let colour = &rgb[3 * i..3 * i + 3];
                    let value = g[0] * colour[0]
                        + g[1] * colour[1]
                        + g[2] * colour[2]
                        + g[3]
                        + g[4] * samples.depths[i];
                    // ∂L/∂α = T (v − B)
                    let to_alpha = transmittance * (value - behind);
                    let at = i - offset;
                    // ∂L/∂c = T α ∂L/∂C
                    for (to, g) in to_rgb[3 * at..3 * at + 3].iter_mut().zip(g) {
                        *to = g * transmittance * alpha;
                    }
                    // α = (1 − exp(−σ δ)) m: ∂α/∂σ = m δ exp(−σ δ), ∂α/∂m = 1 − exp(−σ δ)
                    to_density[at] = to_alpha * likelihood[i] * samples.steps[i] * passed;
                    to_likelihood[at] = to_alpha * (1.0 - passed);
                    // B ← α v + (1 − α) B
                    behind = alpha * value + transmitted(alpha) * behind;
                }
            }
        });
    if let Some(subsampling) = &samples.subsampling {
        subsampling.apply(rgb, density, likelihood, &mut to);
    }
    to
}
