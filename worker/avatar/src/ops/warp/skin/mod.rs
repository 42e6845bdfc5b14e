//! Forward skinning: the transform that carries each canonical point, and what is fixed to it, to its
//! place on the posed body, Σ wᵢ(c) Gᵢ with the motion weights at the point itself. It is what
//! [`super::inverse`] searches the inverse of.

mod autodiff;
pub mod cpu;
pub mod reference;
pub(crate) mod shares;

use super::WarpGrid;
use crate::ops::on_cpu;
use burn::backend::{Backend, Dispatch, backend_extension, tensor::FloatTensor};
use burn::tensor::Tensor;

/// Forward skinning as a backend implements it; other devices have the reference. Call [`skin`]
/// instead.
#[backend_extension(Autodiff, Flex)]
pub trait SkinOps: Backend {
    /// Forward of [`skin`].
    fn skin(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grid: WarpGrid,
    ) -> FloatTensor<Self>;
    /// Gradients of [`skin`] to weights, transforms and points, from `grad` `[N, 12]`.
    fn skin_backward(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        grid: WarpGrid,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>);
}

/// Canonical to posed `[N, 12]`, row-major 3x4, of canonical `points` `[N, 3]`, metres. `weights` and
/// rigid `transforms` as for [`super::warp`]. A point where no bone has a weight goes with the first
/// bone. Gradients flow to all three.
pub fn skin(
    weights: Tensor<2>,
    transforms: Tensor<2>,
    points: Tensor<2>,
    grid: &WarpGrid,
) -> Tensor<2> {
    if on_cpu(&points.device()) {
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
