//! Warp by inverse linear blend skinning (YOTO, eq. 1, after HumanNeRF, arXiv 2201.04127): each bone transforms
//! a point of the posed body into the canonical box and looks its own motion weight up there. The weighted mean of
//! the transformed points is the canonical point, and the sum of the weights is the foreground likelihood:
//! c = Σ wₖ pₖ / Σ wₖ and m = Σ wₖ, with pₖ = Rₖ x + tₖ and wₖ = Wₖ(pₖ).

mod autodiff;
pub mod cpu;
#[cfg(feature = "gpu")]
mod cube;
#[cfg(feature = "gpu")]
mod cube_grid;
#[cfg(feature = "gpu")]
mod cube_rigid;
mod grid;
mod influences;
pub mod inverse;
pub mod likelihood;
mod point_block;
pub mod point_gradients;
pub mod reference;
pub mod skin;
pub mod skin_surface;

pub use grid::WarpGrid;

use super::has_own_form;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, backend_extension};
use burn::tensor::Tensor;

/// Lower bound of Σ wₖ where it divides the canonical point (1e-4 as in HumanNeRF).
pub const MIN_WEIGHT_SUM: f32 = 1e-4;

/// The warp as a backend implements it. Call [`warp`] instead, which chooses the form for the
/// tensors' device.
#[backend_extension(Autodiff, Flex, Cube: cfg(feature = "gpu"), Fusion: cfg(feature = "gpu"))]
pub trait WarpOps: Backend {
    /// Forward of [`warp`].
    #[fusion(dtype = points, shape = output_shape(points))]
    fn warp(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grid: WarpGrid,
    ) -> FloatTensor<Self>;
    /// Gradients of [`warp`] to the weights and the transforms, from `grad` `[N, 4]`.
    #[fusion(meta = |weights, transforms, _, _, _| (weights.clone(), transforms.clone()))]
    fn warp_backward(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        grid: WarpGrid,
    ) -> (FloatTensor<Self>, FloatTensor<Self>);
}

/// Shape of the result of [`warp`] for `points` of this shape.
#[cfg(feature = "gpu")]
fn output_shape(points: &burn::tensor::Shape) -> burn::tensor::Shape {
    burn::tensor::Shape::new([points[0], 4])
}

/// Canonical points and foreground likelihoods.
///
/// `weights` `[K + 1 or K, V]`, V the grid's nodes (bone, then z, y, x; rows after the K-th are not read),
/// `transforms` `[K, 12]` (row-major 3x4, posed body to canonical), `points` `[N, 3]` in the
/// body frame, metres → `[N, 4]`: x, y, z in canonical metres, and the likelihood in [0, 1].
/// Gradients flow to weights and transforms.
pub fn warp(
    weights: Tensor<2>,
    transforms: Tensor<2>,
    points: Tensor<2>,
    grid: &WarpGrid,
) -> Tensor<2> {
    if has_own_form(&points.device()) {
        Tensor::from_dispatch(Dispatch::warp(
            weights.into_dispatch(),
            transforms.into_dispatch(),
            points.into_dispatch(),
            grid.clone(),
        ))
    } else {
        reference::warp(weights, transforms, points, grid)
    }
}
