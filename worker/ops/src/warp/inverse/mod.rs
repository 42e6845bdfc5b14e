//! Canonical points by inverse linear blend skinning: the point that forward skinning with its own
//! weights, Σ wᵢ(c) Gᵢ c, moves to a sample x (SNARF, arXiv 2104.03953, eq. 5). The blend of
//! [`super::warp`] looks up the weight of a bone where that bone alone transforms the sample, which is the right
//! position only if no other bone moves it: with several bones, the blend is off by a centimetre or more
//! (docs/research/quality.md), differently in each pose.
//!
//! The fixed-point iteration c ← (Σ wᵢ(c) Gᵢ)⁻¹ x takes at most [`STEPS`] steps, from the blend or, where that
//! does not converge, from where single bones transform the sample. The search fails where no bone has a weight,
//! the blended transform folds space, or the steps do not become small; then the blend is the result.

mod autodiff;
pub mod cpu;
pub mod point_gradients;
pub mod reference;
pub mod solve;

use super::WarpGrid;
use crate::on_cpu;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, backend_extension};
use burn::tensor::Tensor;

/// Steps of a search. For points near the bones of people in motion, four steps leave an error of 0.1 mm at the
/// 75th percentile, where that of the blend is 29 mm (docs/research/quality.md).
pub const STEPS: usize = 4;
/// Smallest sum of weights at a point that is skinned.
pub(super) const MIN_SUM: f32 = 1e-3;
/// Smallest determinant of a blended transform. It is 1 for a rotation, and 0 where bones whose rotations differ
/// by 180° fold space.
pub(super) const MIN_DETERMINANT: f32 = 0.05;
/// Longest last step of a search that found a point, metres along each axis.
pub(super) const MAX_LAST_STEP: f32 = 2e-3;

/// The search as a backend implements it; other devices run the reference. Call [`unpose`] instead.
#[backend_extension(Autodiff, Flex)]
pub trait InverseOps: Backend {
    /// Forward of [`unpose`], `[N, 4]`: the point, and 1 if it was found or 0 if it is the fallback.
    fn unpose(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        near: FloatTensor<Self>,
        fallback: FloatTensor<Self>,
        grid: WarpGrid,
        steps: usize,
    ) -> FloatTensor<Self>;
    /// Gradients of [`unpose`] to weights, transforms and `fallback`, from its result and the gradient
    /// `[N, 4]` to it, whose last column is not read.
    fn unpose_backward(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        found: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        grid: WarpGrid,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>);
}

/// Canonical points `[N, 3]`, metres. `weights`, `transforms` (rigid) and `points` as for
/// [`super::warp`]. Each point is searched in at most `steps` steps from `near` `[N, 3]`; where the search fails,
/// the point of `fallback` `[N, 3]` is the result. Gradients flow to weights and transforms, by the implicit
/// function theorem, and to `fallback`.
pub fn unpose(
    weights: Tensor<2>,
    transforms: Tensor<2>,
    points: Tensor<2>,
    near: Tensor<2>,
    fallback: Tensor<2>,
    grid: &WarpGrid,
    steps: usize,
) -> Tensor<2> {
    if on_cpu(&points.device()) {
        let [n, _] = points.dims();
        let found: Tensor<2> = Tensor::from_dispatch(Dispatch::unpose(
            weights.into_dispatch(),
            transforms.into_dispatch(),
            points.into_dispatch(),
            near.into_dispatch(),
            fallback.into_dispatch(),
            grid.clone(),
            steps,
        ));
        found.slice([0..n, 0..3])
    } else {
        reference::unpose(weights, transforms, points, near, fallback, grid, steps)
    }
}
