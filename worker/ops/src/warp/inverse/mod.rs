//! Canonical points by inverse linear blend skinning: the point that forward skinning with its own
//! weights, Σ wᵢ(c) Gᵢ c, puts where a sample is (SNARF, arXiv 2104.03953, eq. 5). The blend of
//! [`super::warp`] looks each bone's weight up where that bone carries the sample, which is where
//! the skin was only if a single bone moves it: with several, it is a centimetre or more beside
//! (docs/quality.md), elsewhere in each pose.
//!
//! c ← (Σ wᵢ(c) Gᵢ)⁻¹ x is repeated at most [`STEPS`] times, from the blend or, where that leads
//! nowhere, from where single bones carry the sample. A search fails where no bone has a weight, the
//! blended transform folds space, or the steps do not become small; then the blend is the result.

mod autodiff;
pub mod cpu;
pub mod pulls;
pub mod reference;
pub mod solve;

use super::WarpGrid;
use crate::on_cpu;
use burn::backend::{Backend, Dispatch, backend_extension, tensor::FloatTensor};
use burn::tensor::Tensor;

/// Steps of a search. Of points near the bones of people in motion, four leave 0.1 mm at the 75th
/// percentile, where the blend is 29 mm off (docs/quality.md).
pub const STEPS: usize = 4;
/// Smallest sum of weights at a point that is skinned.
pub(super) const MIN_SUM: f32 = 1e-3;
/// Smallest determinant of a blended transform. It is 1 for a rotation, and 0 where bones that are
/// turned against each other by half a turn fold space.
pub(super) const MIN_VOLUME: f32 = 0.05;
/// Longest last step of a search that found a point, metres along each axis.
pub(super) const CLOSE: f32 = 2e-3;

/// The search as a backend implements it; other devices have the reference. Call [`unpose`] instead.
#[backend_extension(Autodiff, Flex)]
pub trait InverseOps: Backend {
    /// Forward of [`unpose`], `[N, 4]`: the point, and 1 if it was found, 0 if it is `otherwise`.
    fn unpose(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        near: FloatTensor<Self>,
        otherwise: FloatTensor<Self>,
        grid: WarpGrid,
        steps: usize,
    ) -> FloatTensor<Self>;
    /// Gradients of [`unpose`] to weights, transforms and `otherwise`, from its result and the gradient
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
/// [`super::warp`]. Each is searched in at most `steps` steps from `near` `[N, 3]`; it is that of
/// `otherwise` `[N, 3]` where the search fails. Gradients flow to weights and transforms, by the
/// theorem of implicit functions, and to `otherwise`.
pub fn unpose(
    weights: Tensor<2>,
    transforms: Tensor<2>,
    points: Tensor<2>,
    near: Tensor<2>,
    otherwise: Tensor<2>,
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
            otherwise.into_dispatch(),
            grid.clone(),
            steps,
        ));
        found.slice([0..n, 0..3])
    } else {
        reference::unpose(weights, transforms, points, near, otherwise, grid, steps)
    }
}
