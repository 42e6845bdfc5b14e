//! Volume rendering (paper eq. 9) of samples that lie ray by ray, near to far:
//! α = (1 − exp(−σ δ)) m, C = Σ T α c, and T the product of 1 − α over the samples before.
//!
//! A ray may be stopped early: once its transmittance is under a bound, later samples weigh
//! exactly nothing and get gradients of exactly zero, so that whoever computes them backwards
//! can leave them out. Colour and opacity are then wrong by at most the bound.

pub mod cpu;
#[cfg(feature = "gpu")]
pub(super) mod cube;
mod integrate;
pub mod reference;
mod thinning;

pub use cpu::Light;
pub use thinning::Thinning;

pub(super) use integrate::{Three, flex, flex_backward, tracked};

use super::{AvatarOps, has_own_form};
use burn::backend::Dispatch;
use burn::tensor::Tensor;
use std::sync::Arc;

/// Keeps a transmittance over 0 where a sample is opaque (HumanNeRF), so that what is hidden
/// is still felt, if by nothing that shows.
pub const OPAQUE: f32 = 1e-10;

/// Where the samples of some rays are.
#[derive(Clone, Debug)]
pub struct RaySamples {
    /// `[R + 1]`: the samples of ray r are numbers `starts[r]..starts[r + 1]`, near to far.
    pub starts: Arc<[usize]>,
    /// `[n]` step lengths, metres.
    pub steps: Arc<[f32]>,
    /// `[n]` distances along the camera's axis, metres.
    pub depths: Arc<[f32]>,
    /// Samples behind this transmittance weigh nothing; 0 keeps all.
    pub min_transmittance: f32,
    /// Which samples gradients flow to, on the CPU; `None`: to all. A GPU runs all rows of its
    /// networks at once and would gain nothing.
    pub thinning: Option<Thinning>,
}

impl RaySamples {
    /// R.
    pub fn rays(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }
}

/// Of what [`composite`] yields.
#[cfg(feature = "gpu")]
pub(super) fn output_shape(samples: &RaySamples) -> burn::tensor::Shape {
    burn::tensor::Shape::new([samples.rays(), 5])
}

/// `rgb` `[n, 3]`, `density` `[n]` 1/m, `likelihood` `[n]` → `[R, 5]`: colour over black,
/// opacity, and Σ T α z in metres, not divided by opacity. Gradients flow to all three.
pub fn composite(
    rgb: Tensor<2>,
    density: Tensor<1>,
    likelihood: Tensor<1>,
    samples: &RaySamples,
) -> Tensor<2> {
    if has_own_form(&rgb.device()) {
        Tensor::from_dispatch(Dispatch::composite(
            rgb.into_dispatch(),
            density.into_dispatch(),
            likelihood.into_dispatch(),
            samples.clone(),
        ))
    } else {
        reference::composite(rgb, density, likelihood, samples)
    }
}
