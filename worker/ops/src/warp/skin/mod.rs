//! Forward linear blend skinning: the transform Σ wᵢ(c) Gᵢ that moves each canonical point c, and what is fixed to
//! it, to its position on the posed body, with the motion weights at the point itself. [`super::inverse`]
//! searches its inverse.

mod autodiff;
pub mod cpu;
#[cfg(feature = "gpu")]
mod cube;
pub mod reference;
pub mod weights;

use super::WarpGrid;
use crate::has_own_form;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, backend_extension};
use burn::tensor::Tensor;

/// Forward skinning as a backend implements it. Call [`skin`] instead, which chooses the form for the
/// tensors' device.
#[backend_extension(Autodiff, Flex, Cube: cfg(feature = "gpu"), Fusion: cfg(feature = "gpu"))]
pub trait SkinOps: Backend {
    /// Forward of [`skin`].
    #[fusion(dtype = points, shape = output_shape(points))]
    fn skin(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grid: WarpGrid,
    ) -> FloatTensor<Self>;
    /// Gradients of [`skin`] to weights, transforms and points, from `grad` `[N, 12]`.
    #[fusion(meta = |weights, transforms, points, _, _| {
        (weights.clone(), transforms.clone(), points.clone())
    })]
    fn skin_backward(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        grid: WarpGrid,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>);
}

/// Shape of the result of [`skin`] at `points` of this shape.
#[cfg(feature = "gpu")]
fn output_shape(points: &burn::tensor::Shape) -> burn::tensor::Shape {
    burn::tensor::Shape::new([points[0], 12])
}

/// Canonical to posed `[N, 12]`, row-major 3x4, of canonical `points` `[N, 3]`, metres. `weights` and
/// rigid `transforms` as for [`super::warp`]. A point where no bone has a weight moves with the first
/// bone. Gradients flow to all three.
pub fn skin(
    weights: Tensor<2>,
    transforms: Tensor<2>,
    points: Tensor<2>,
    grid: &WarpGrid,
) -> Tensor<2> {
    if has_own_form(&points.device()) {
        Tensor::from_dispatch(Dispatch::skin(
            weights.into_dispatch(),
            transforms.into_dispatch(),
            points.into_dispatch(),
            grid.clone(),
        ))
    } else {
        reference::skin(weights, transforms, points, grid)
    }
}
