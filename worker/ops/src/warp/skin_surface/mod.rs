//! Forward linear blend skinning of points that lie on a body's surface: bones and base weights of each point come from
//! that surface, and a volume of factors changes the weights. A point x moves by Σ wᵢ Gᵢ with
//! wᵢ = bᵢ fᵢ(x) / Σ bⱼ fⱼ(x), base weights b, and fᵢ the trilinear interpolation of the factors of the i-th bone. So
//! only the bones of a point can move it, whatever the factors are, while [`super::skin`] looks all weights up in a
//! volume, whose nodes at one side of a gap between limbs also count at the other side. Bones too small for the volume, as
//! those of fingers, have the factor 1 everywhere.

mod autodiff;
pub mod cpu;
#[cfg(feature = "gpu")]
mod cube;
pub mod reference;
mod surface;
mod weights;

use super::WarpGrid;
use crate::has_own_form;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, backend_extension};
use burn::tensor::Tensor;

/// Largest number of bones per point.
pub const MAX_BONES: usize = 8;
/// Smallest Σ bⱼ fⱼ that weights are divided by; below it, the base weights are used.
pub(super) const MIN_SUM: f32 = 1e-12;

/// Forward skinning of a surface as a backend implements it. Call [`skin_surface`] instead, which chooses the form for
/// the tensors' device.
#[backend_extension(Autodiff, Flex, Cube: cfg(feature = "gpu"), Fusion: cfg(feature = "gpu"))]
#[allow(clippy::too_many_arguments)]
pub trait SkinSurfaceOps: Backend {
    /// Forward of [`skin_surface`].
    #[fusion(dtype = points, shape = output_shape(points))]
    fn skin_surface(
        factors: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        bones: FloatTensor<Self>,
        weights: FloatTensor<Self>,
        factored: usize,
        grid: WarpGrid,
    ) -> FloatTensor<Self>;
    /// Gradients of [`skin_surface`] to factors, transforms and points, from `grad` `[N, 12]`.
    #[fusion(meta = |factors, transforms, points, _, _, _, _, _| {
        (factors.clone(), transforms.clone(), points.clone())
    })]
    fn skin_surface_backward(
        factors: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        bones: FloatTensor<Self>,
        weights: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        factored: usize,
        grid: WarpGrid,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>);
}

/// Shape of the result of [`skin_surface`] at `points` of this shape.
#[cfg(feature = "gpu")]
fn output_shape(points: &burn::tensor::Shape) -> burn::tensor::Shape {
    burn::tensor::Shape::new([points[0], 12])
}

/// Canonical to posed `[N, 12]`, row-major 3x4, of canonical `points` `[N, 3]`, metres.
///
/// `factors` `[C, V]`, positive, C at least `factored` and V the grid's nodes (bone, then z, y, x; rows after those of the first
/// `factored` bones are not read). Bones after them have the factor 1. `transforms` `[K, 12]`, rigid, posed body to canonical, as for [`super::warp`]. `bones` `[N, B]`, B at most
/// [`MAX_BONES`], are the indices of each point's bones, integers below K. `weights` `[N, B]` are the base weights of
/// these bones, at least 0, which sum to 1.
///
/// Outside the grid's box, and where the factors leave nearly no weight, a point has its base weights. Gradients flow to
/// factors, transforms and points; bones and base weights are constants. The grid's floor is not read.
///
/// # Panics
/// On CPUs, if a bone is not below K, or B is 0 or more than [`MAX_BONES`].
pub fn skin_surface(
    factors: Tensor<2>,
    transforms: Tensor<2>,
    points: Tensor<2>,
    bones: Tensor<2>,
    weights: Tensor<2>,
    factored: usize,
    grid: &WarpGrid,
) -> Tensor<2> {
    if has_own_form(&points.device()) {
        Tensor::from_dispatch(Dispatch::skin_surface(
            factors.into_dispatch(),
            transforms.into_dispatch(),
            points.into_dispatch(),
            bones.into_dispatch(),
            weights.into_dispatch(),
            factored,
            grid.clone(),
        ))
    } else {
        reference::skin_surface(factors, transforms, points, bones, weights, factored, grid)
    }
}
