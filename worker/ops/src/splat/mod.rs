//! Pictures of Gaussians on the surface of a posed body (3D Gaussian splatting, Kerbl and others,
//! arXiv 2308.04079). Each splat has a transform of its own, which poses it; posed splats are projected, sorted
//! into tiles, and rasterized near to far.
//!
//! A splat's covariance in the picture is Σ' = J W Σ Wᵀ Jᵀ + [`LOW_PASS`] I with Σ = R S Sᵀ Rᵀ, where J is the
//! Jacobian of the projection, W = E A the camera's rotation times the linear part of the splat's transform, R
//! its rotation and S its scales. Its opacity at a pixel whose centre is at the offset d is
//! α = o exp(−dᵀ Σ'⁻¹ d / 2), at most [`MAX_ALPHA`], and 0 below [`MIN_ALPHA`]. Its colour is multiplied by the
//! light on its third axis, the normal of the surface ([`light`]).
//!
//! The forward pass is [`cpu`]'s `project`, then `rasterize`; the backward pass `rasterize_backward`, then
//! `project_backward`. On a GPU, kernels have the same names.

mod autodiff;
pub mod cpu;
#[cfg(feature = "gpu")]
mod cube;
pub mod harmonics;
pub mod light;
pub mod probe;
mod projected;
mod projected_backward;
mod rasterize;
pub mod reference;
mod row;
mod tiles;

pub use cpu::{Rendered, render};
pub use row::{ROW, SplatRow, means_of_rows, splat_rows};

use super::has_own_form;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, backend_extension};
use burn::tensor::Tensor;
use light::LIGHTS;

/// Variance that is added to a splat's along both axes of the picture, for the area of a pixel, pixels²: about the
/// 1/12 of a unit square. 3DGS adds 0.3.
pub const LOW_PASS: f32 = 0.1;
/// Largest opacity α of a splat at a pixel (as in 3DGS), so that what is behind it still has gradients.
pub const MAX_ALPHA: f32 = 0.99;
/// Smallest opacity α of a splat at a pixel (as in 3DGS), below which it is 0: a step of 8-bit colour.
pub const MIN_ALPHA: f32 = 1.0 / 255.0;
/// Near plane: smallest z in the camera's frame, metres.
pub const NEAR: f32 = 0.05;

/// A camera in the frame of the body.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Width of the picture, pixels.
    pub width: usize,
    /// Height of the picture, pixels.
    pub height: usize,
    /// Intrinsics K, pixels: `[[fx, skew, cx], [0, fy, cy]]`, pixel centres at +0.5.
    pub k: [[f32; 3]; 2],
    /// Extrinsics E: body frame to camera, row-major 3x4, metres.
    pub e: [[f32; 4]; 3],
    /// Rotation from the body frame to the world, in which light has a direction.
    pub world: [[f32; 3]; 3],
}

/// Splats as tensors.
#[derive(Clone, Debug)]
pub struct Splats {
    /// `[N, 12]` canonical to posed body, row-major 3x4.
    pub transforms: Tensor<2>,
    /// `[N, 3]` canonical means, metres.
    pub means: Tensor<2>,
    /// `[N, 4]` canonical rotations: quaternions, real part first, of any length but 0.
    pub rotations: Tensor<2>,
    /// `[N, 3]` logarithms of the standard deviations along the rotated axes, metres.
    pub scales: Tensor<2>,
    /// `[N]` logits of the opacities.
    pub opacities: Tensor<1>,
    /// `[N, 3]` colours without light.
    pub colours: Tensor<2>,
    /// `[N, 3 K]` coefficients of the view-dependent colour, by harmonic and channel ([`harmonics`]); `None` if
    /// colours do not depend on the view.
    pub harmonics: Option<Tensor<2>>,
    /// `[3, 8]` light of each colour channel ([`light`]).
    pub light: Tensor<2>,
}

impl Splats {
    /// Checks that the shapes match.
    ///
    /// # Panics
    /// If they do not match.
    fn check(&self) {
        let [n, _] = self.means.dims();
        assert_eq!(self.transforms.dims(), [n, 12]);
        assert_eq!(self.means.dims(), [n, 3]);
        assert_eq!(self.rotations.dims(), [n, 4]);
        assert_eq!(self.scales.dims(), [n, 3]);
        assert_eq!(self.opacities.dims(), [n]);
        assert_eq!(self.colours.dims(), [n, 3]);
        assert_eq!(self.light.dims(), [3, LIGHTS]);
        if let Some(harmonics) = &self.harmonics {
            let known = [1, 2].map(|degree| [n, 3 * harmonics::count(degree)]);
            assert!(known.contains(&harmonics.dims()));
        }
    }

    /// `[N, 14]`: mean, rotation, scales, opacity and colour of each splat, without the view-dependent colour.
    pub fn rows(&self) -> Tensor<2> {
        let [n, _] = self.means.dims();
        let opacities = self.opacities.clone().reshape([n, 1]);
        let parts = [&self.means, &self.rotations, &self.scales].map(Tensor::clone);
        let parts = parts.into_iter().chain([opacities, self.colours.clone()]);
        Tensor::cat(parts.collect(), 1)
    }
}

/// Splatting as a backend implements it. Call [`splat`] instead, which chooses the form for the device of
/// the tensors.
#[backend_extension(Autodiff, Flex, Cube: cfg(feature = "gpu"), Fusion: cfg(feature = "gpu"))]
pub trait SplatOps: Backend {
    /// Forward of [`splat`], from the transforms `[N, 12]`, the rows `[N, 14]` of the splats and the light
    /// `[3, 8]`.
    #[fusion(dtype = rows, shape = output_shape(view))]
    fn splat(
        transforms: FloatTensor<Self>,
        rows: FloatTensor<Self>,
        light: FloatTensor<Self>,
        view: View,
    ) -> FloatTensor<Self>;
    /// Gradients of [`splat`] to its three inputs, from its result `picture` and the gradient to it, both
    /// `[H W, 4]`.
    #[fusion(meta = |transforms, rows, light, _, _, _| {
        (transforms.clone(), rows.clone(), light.clone())
    })]
    fn splat_backward(
        transforms: FloatTensor<Self>,
        rows: FloatTensor<Self>,
        light: FloatTensor<Self>,
        picture: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        view: View,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>);
}

/// Shape of the result of [`splat`].
#[cfg(feature = "gpu")]
fn output_shape(view: &View) -> burn::tensor::Shape {
    burn::tensor::Shape::new([view.width * view.height, 4])
}

/// The picture `[H W, 4]` of `splats`: colour over black, and opacity. Gradients flow to all tensors of
/// `splats`.
///
/// # Panics
/// If the shapes do not match.
pub fn splat(splats: Splats, view: &View) -> Tensor<2> {
    splats.check();
    let splats = splats.with_view_colours(view);
    if has_own_form(&splats.means.device()) {
        let rows = splats.rows();
        Tensor::from_dispatch(Dispatch::splat(
            splats.transforms.into_dispatch(),
            rows.into_dispatch(),
            splats.light.into_dispatch(),
            view.clone(),
        ))
    } else {
        reference::splat(splats, view)
    }
}
