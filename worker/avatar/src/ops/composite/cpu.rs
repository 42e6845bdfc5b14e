//! Compositing on CPU threads, ray by ray.
//!
//! Backward needs no division by 1 − α, which can be 0: it carries from far to near what a
//! unit of light that passes a sample would still see, B ← α v + (1 − α) B, and the gradient
//! to a sample's α is T (v − B), v being its value along the output's gradient.

use super::{OPAQUE, RaySamples};
use rayon::prelude::*;

/// Rays a task: enough to hide the hand-over.
const BLOCK: usize = 128;

/// What a ray has seen so far, over black.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Σ T α c.
    pub rgb: [f32; 3],
    /// Σ T α.
    pub alpha: f32,
    /// Σ T α z, metres.
    pub depth: f32,
    /// T: what still comes through.
    pub clear: f32,
}

impl Light {
    /// Before the first sample.
    pub const START: Self = Self {
        rgb: [0.0; 3],
        alpha: 0.0,
        depth: 0.0,
        clear: 1.0,
    };

    /// Adds a sample of opacity `alpha` behind the ones before.
    #[inline(always)]
    pub fn add(&mut self, rgb: &[f32], alpha: f32, depth: f32) {
        let weight = self.clear * alpha;
        for (sum, channel) in self.rgb.iter_mut().zip(rgb) {
            *sum += weight * channel;
        }
        self.alpha += weight;
        self.depth += weight * depth;
        self.clear *= through(alpha);
    }
}

/// What a sample lets through. In two sums: 1 + 1e-10 is 1 in f32.
#[inline(always)]
fn through(alpha: f32) -> f32 {
    1.0 - alpha + OPAQUE
}

/// Opacity of a sample of `density` 1/m, `step` metres long.
#[inline(always)]
pub fn opacity(density: f32, step: f32, likelihood: f32) -> f32 {
    (1.0 - (-density * step).exp()) * likelihood
}

/// `[R, 5]` as in [`super::composite`].
pub fn forward(rgb: &[f32], density: &[f32], likelihood: &[f32], samples: &RaySamples) -> Vec<f32> {
    let mut output = vec![0f32; samples.rays() * 5];
    output
        .par_chunks_mut(5 * BLOCK)
        .zip(samples.starts.par_windows(2).chunks(BLOCK))
        .for_each(|(output, rays)| {
            for (out, ray) in output.chunks_exact_mut(5).zip(rays) {
                let mut light = Light::START;
                for i in ray[0]..ray[1] {
                    if light.clear < samples.min_transmittance {
                        break;
                    }
                    let alpha = opacity(density[i], samples.steps[i], likelihood[i]);
                    light.add(&rgb[3 * i..3 * i + 3], alpha, samples.depths[i]);
                }
                out[..3].copy_from_slice(&light.rgb);
                out[3] = light.alpha;
                out[4] = light.depth;
            }
        });
    output
}

/// Gradients to rgb `[n, 3]`, density `[n]` and likelihood `[n]`.
pub struct Gradients {
    /// `[n, 3]`.
    pub rgb: Vec<f32>,
    /// `[n]`.
    pub density: Vec<f32>,
    /// `[n]`.
    pub likelihood: Vec<f32>,
}

/// Gradients of [`forward`] from `grad` `[R, 5]`.
pub fn backward(
    rgb: &[f32],
    density: &[f32],
    likelihood: &[f32],
    grad: &[f32],
    samples: &RaySamples,
) -> Gradients {
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
            // Transmittance before each sample, and what is left of it after.
            let mut passed: Vec<[f32; 2]> = Vec::new();
            for ray in rays {
                let (start, end) = (samples.starts[ray], samples.starts[ray + 1]);
                let g = &grad[5 * ray..5 * ray + 5];
                passed.clear();
                let mut clear = 1f32;
                for i in start..end {
                    if clear < samples.min_transmittance {
                        break;
                    }
                    let left = (-density[i] * samples.steps[i]).exp();
                    passed.push([clear, left]);
                    clear *= through((1.0 - left) * likelihood[i]);
                }
                let mut behind = 0f32;
                for (i, [clear, left]) in (start..start + passed.len()).zip(&passed).rev() {
                    let alpha = (1.0 - left) * likelihood[i];
                    let colour = &rgb[3 * i..3 * i + 3];
                    let value = g[0] * colour[0]
                        + g[1] * colour[1]
                        + g[2] * colour[2]
                        + g[3]
                        + g[4] * samples.depths[i];
                    let to_alpha = clear * (value - behind);
                    let at = i - offset;
                    for (to, g) in to_rgb[3 * at..3 * at + 3].iter_mut().zip(g) {
                        *to = g * clear * alpha;
                    }
                    to_density[at] = to_alpha * likelihood[i] * samples.steps[i] * left;
                    to_likelihood[at] = to_alpha * (1.0 - left);
                    behind = alpha * value + through(alpha) * behind;
                }
            }
        });
    if let Some(thinning) = &samples.thinning {
        thinning.apply(rgb, density, likelihood, &mut to);
    }
    to
}
