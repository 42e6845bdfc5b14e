//! Pictures of Gaussians on a posed body's surface (3D Gaussian splatting, Kerbl and others,
//! arXiv 2308.04079): each is carried to its place by a transform of its own, projected, and blended
//! near to far.
//!
//! A splat's covariance in the picture is J A R S Sᵀ Rᵀ Aᵀ Jᵀ + [`LOW_PASS`], of the projection's
//! Jacobian J, the linear part A of its transform, its turn R and its scales S. Its opacity at a pixel
//! centre at distance d is o exp(−dᵀ Σ⁻¹ d / 2), at most [`MOST`] and none below [`LEAST`]. Its colour
//! is multiplied by the light on its third axis, the surface's normal ([`light`]).

mod autodiff;
pub mod cpu;
#[cfg(feature = "gpu")]
mod cube;
mod flat;
pub mod harmonics;
pub mod light;
pub mod probe;
mod raster;
pub mod reference;
mod tiles;

pub use cpu::{Drawn, draw};

use super::has_own_form;
use burn::backend::{Backend, Dispatch, backend_extension, tensor::FloatTensor};
use burn::tensor::Tensor;
use light::LIGHTS;

/// Variance that a pixel's area adds to a splat's, square pixels: about the 1/12 of a square.
pub const LOW_PASS: f32 = 0.1;
/// Largest opacity of a splat at a pixel (3DGS), so that what is behind still has gradients.
pub const MOST: f32 = 0.99;
/// Smallest opacity of a splat at a pixel (3DGS): a step of 8-bit colour.
pub const LEAST: f32 = 1.0 / 255.0;
/// Nearest distance from the camera, metres.
pub const NEAR: f32 = 0.05;

/// Numbers of a splat: place, turn, scales, opacity and colour.
pub const ROW: usize = 14;

/// A camera in the frame of the body.
#[derive(Clone, Debug, PartialEq)]
pub struct Sight {
    /// Width of the picture, pixels.
    pub width: usize,
    /// Height of the picture, pixels.
    pub height: usize,
    /// Intrinsics, pixels: `[[fx, skew, cx], [0, fy, cy]]`, pixel centres at +0.5.
    pub k: [[f32; 3]; 2],
    /// Body frame to camera, row-major 3x4, metres.
    pub e: [[f32; 4]; 3],
    /// Turn from the body frame to the world, in which light has a direction.
    pub world: [[f32; 3]; 3],
}

/// Splats as tensors.
#[derive(Clone, Debug)]
pub struct Splats {
    /// `[N, 12]` canonical to posed body, row-major 3x4.
    pub transforms: Tensor<2>,
    /// `[N, 3]` canonical places, metres.
    pub means: Tensor<2>,
    /// `[N, 4]` canonical turns as quaternions, real part first, of any length but 0.
    pub turns: Tensor<2>,
    /// `[N, 3]` logarithms of the standard deviations along the turned axes, metres.
    pub scales: Tensor<2>,
    /// `[N]` logits of the opacities.
    pub opacities: Tensor<1>,
    /// `[N, 3]` colours without light.
    pub colours: Tensor<2>,
    /// `[N, 3 K]`: what the colours gain by the view, by harmonic and channel ([`harmonics`]); absent if they do
    /// not depend on it.
    pub harmonics: Option<Tensor<2>>,
    /// `[3, 8]` light of each colour channel ([`light`]).
    pub light: Tensor<2>,
}

impl Splats {
    /// Checks that the shapes belong together.
    ///
    /// # Panics
    /// If they do not.
    fn check(&self) {
        let [n, _] = self.means.dims();
        assert_eq!(self.transforms.dims(), [n, 12]);
        assert_eq!(self.means.dims(), [n, 3]);
        assert_eq!(self.turns.dims(), [n, 4]);
        assert_eq!(self.scales.dims(), [n, 3]);
        assert_eq!(self.opacities.dims(), [n]);
        assert_eq!(self.colours.dims(), [n, 3]);
        assert_eq!(self.light.dims(), [3, LIGHTS]);
        if let Some(harmonics) = &self.harmonics {
            let known = [1, 2].map(|degree| [n, 3 * harmonics::count(degree)]);
            assert!(known.contains(&harmonics.dims()));
        }
    }

    /// `[N, 14]`: place, turn, scales, opacity and colour of each, as the operation takes them, without what colours
    /// gain by the view.
    pub fn rows(&self) -> Tensor<2> {
        let [n, _] = self.means.dims();
        let opacities = self.opacities.clone().reshape([n, 1]);
        let parts = [&self.means, &self.turns, &self.scales].map(Tensor::clone);
        let parts = parts.into_iter().chain([opacities, self.colours.clone()]);
        Tensor::cat(parts.collect(), 1)
    }
}

/// Splatting as a backend implements it. Call [`splat`] instead: it chooses the form for the tensors'
/// device.
#[backend_extension(Autodiff, Flex, Cube: cfg(feature = "gpu"), Fusion: cfg(feature = "gpu"))]
pub trait SplatOps: Backend {
    /// Forward of [`splat`], from the transforms `[N, 12]`, the splats' rows `[N, 14]` and the light
    /// `[3, 8]`.
    #[fusion(dtype = rows, shape = output_shape(sight))]
    fn splat(
        transforms: FloatTensor<Self>,
        rows: FloatTensor<Self>,
        light: FloatTensor<Self>,
        sight: Sight,
    ) -> FloatTensor<Self>;
    /// Gradients of [`splat`] to its inputs, from its result and the gradient to it.
    #[fusion(meta = |transforms, rows, light, _, _, _| {
        (transforms.clone(), rows.clone(), light.clone())
    })]
    fn splat_backward(
        transforms: FloatTensor<Self>,
        rows: FloatTensor<Self>,
        light: FloatTensor<Self>,
        picture: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        sight: Sight,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>);
}

/// Shape of the result of [`splat`].
#[cfg(feature = "gpu")]
fn output_shape(sight: &Sight) -> burn::tensor::Shape {
    burn::tensor::Shape::new([sight.width * sight.height, 4])
}

/// The picture `[H W, 4]` of `splats`: colour over black, and opacity. Gradients flow to all tensors.
///
/// # Panics
/// If the shapes do not belong together.
pub fn splat(splats: Splats, sight: &Sight) -> Tensor<2> {
    splats.check();
    let splats = splats.seen_from(sight);
    if has_own_form(&splats.means.device()) {
        let rows = splats.rows();
        Tensor::from_dispatch(Dispatch::splat(
            splats.transforms.into_dispatch(),
            rows.into_dispatch(),
            splats.light.into_dispatch(),
            sight.clone(),
        ))
    } else {
        reference::splat(splats, sight)
    }
}
