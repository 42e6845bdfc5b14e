//! Volume rendering (YOTO, eq. 9; HumanNeRF, arXiv 2201.04127) of samples that are listed ray by ray, near to far:
//! C = Σ T α c with α = (1 − exp(−σ δ)) m, and T the product of 1 − α over the samples in front.
//!
//! A ray may end early: once its transmittance is below a bound, later samples have a weight and
//! gradients of exactly zero, so that the backward passes of the networks can leave them out.
//! The error of colour and opacity is then at most the bound.

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
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, backend_extension};
use burn::tensor::Tensor;
use std::sync::Arc;

/// Added to 1 − α (as in HumanNeRF): transmittance stays above 0 behind an opaque sample, so that hidden
/// samples still get gradients. They are too small to be seen in a picture.
pub const OPAQUE: f32 = 1e-10;

/// Positions of the samples of R rays, n in total.
#[derive(Clone, Debug)]
pub struct RaySamples {
    /// `[R + 1]`: ray r has the samples `starts[r]..starts[r + 1]`, near to far.
    pub starts: Arc<[usize]>,
    /// `[n]` step lengths, metres.
    pub steps: Arc<[f32]>,
    /// `[n]` distances from the camera along its axis, metres.
    pub depths: Arc<[f32]>,
    /// Samples behind a smaller transmittance have weight 0; 0 keeps all samples.
    pub min_transmittance: f32,
    /// Choice of the samples that gradients flow to, on the CPU; `None` for all samples. A GPU runs
    /// all rows of its networks at once and would gain nothing.
    pub subsampling: Option<GradientSubsampling>,
}

impl RaySamples {
    /// Number of rays R.
    ///
    /// # Panics
    /// If `starts` is empty: for no rays, it must still have one number.
    pub fn rays(&self) -> usize {
        assert!(
            !self.starts.is_empty(),
            "starts of R rays are R + 1 numbers"
        );
        self.starts.len() - 1
    }
}

/// Compositing as a backend implements it. Call [`composite`] instead, which chooses
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
