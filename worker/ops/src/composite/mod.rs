//! Volume rendering (YOTO, eq. 9) of samples that are listed ray by ray, near to far:
//! α = (1 − exp(−σ δ)) m, C = Σ T α c, and T the product of 1 − α over the samples before.
//!
//! A ray may end early: once its transmittance is under a bound, later samples have a weight and
//! gradients of exactly zero, so that the backward passes of the networks can leave them out.
//! Colour and opacity are then wrong by at most the bound.

mod accumulator;
mod autodiff;
pub mod cpu;
#[cfg(feature = "gpu")]
mod cube;
pub mod reference;
mod subsampling;

pub use accumulator::{RayAccumulator, opacity};
pub use subsampling::GradientSubsampling;

use super::has_own_form;
use burn::backend::{Backend, Dispatch, backend_extension, tensor::FloatTensor};
use burn::tensor::Tensor;
use std::sync::Arc;

/// Added to 1 − α (HumanNeRF): transmittance stays over 0 behind an opaque sample, so that hidden
/// samples still get gradients, too small to show.
pub const OPAQUE: f32 = 1e-10;

/// Positions of the samples of R rays, n in total.
#[derive(Clone, Debug)]
pub struct RaySamples {
    /// `[R + 1]`: the samples of ray r are numbers `starts[r]..starts[r + 1]`, near to far.
    pub starts: Arc<[usize]>,
    /// `[n]` step lengths, metres.
    pub steps: Arc<[f32]>,
    /// `[n]` distances from the camera along its axis, metres.
    pub depths: Arc<[f32]>,
    /// Samples that a smaller share of the light reaches have weight 0; 0 keeps all.
    pub min_transmittance: f32,
    /// Choice of the samples that gradients flow to, on the CPU; `None`: all of them. A GPU runs
    /// all rows of its networks at once and would gain nothing.
    pub subsampling: Option<GradientSubsampling>,
}

impl RaySamples {
    /// Number of rays R.
    ///
    /// # Panics
    /// If `starts` is empty: even of no rays it holds one number.
    pub fn rays(&self) -> usize {
        assert!(
            !self.starts.is_empty(),
            "starts of R rays are R + 1 numbers"
        );
        self.starts.len() - 1
    }
}

/// Compositing as a backend implements it. Call [`composite`] instead: it chooses
/// the form for the tensors' device.
#[backend_extension(Autodiff, Flex, Cube: cfg(feature = "gpu"), Fusion: cfg(feature = "gpu"))]
pub trait CompositeOps: Backend {
    /// Forward of [`composite`].
    #[fusion(dtype = rgb, shape = output_shape(samples))]
    fn composite(
        rgb: FloatTensor<Self>,
        density: FloatTensor<Self>,
        likelihood: FloatTensor<Self>,
        samples: RaySamples,
    ) -> FloatTensor<Self>;
    /// Gradients of [`composite`] to rgb, density and likelihood, from `grad`
    /// `[R, 5]`.
    #[fusion(meta = |rgb, density, likelihood, _, _| {
        (rgb.clone(), density.clone(), likelihood.clone())
    })]
    fn composite_backward(
        rgb: FloatTensor<Self>,
        density: FloatTensor<Self>,
        likelihood: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        samples: RaySamples,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>);
}

/// Shape of the result of [`composite`].
#[cfg(feature = "gpu")]
fn output_shape(samples: &RaySamples) -> burn::tensor::Shape {
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
