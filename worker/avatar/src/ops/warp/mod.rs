//! Warp by inverse linear blend skinning (model.md §2, paper eq. 1): each bone carries a point
//! of the posed body into the canonical box and looks its own motion weight up there; the
//! weighted mean of the carried points is the canonical point, the sum of the weights is the
//! foreground likelihood.

pub mod cpu;
#[cfg(feature = "gpu")]
pub(super) mod cube;
mod grid;
#[cfg(feature = "gpu")]
mod lattice;
pub mod likelihood;
pub mod reference;
mod visits;

pub use grid::WarpGrid;

use super::{AvatarOps, has_own_form};
use burn::backend::Dispatch;
use burn::tensor::Tensor;

/// The least sum of weights that the canonical point is divided by (HumanNeRF's 1e-4).
pub const MIN_WEIGHT_SUM: f32 = 1e-4;

/// Of what [`warp`] yields for `points` of this shape.
#[cfg(feature = "gpu")]
pub(super) fn output_shape(points: &burn::tensor::Shape) -> burn::tensor::Shape {
    burn::tensor::Shape::new([points[0], 4])
}

/// Canonical points and foreground likelihoods.
///
/// `weights` `[K + 1 or K, D³]` (bone, then z, y, x; rows after the K-th are not read),
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
