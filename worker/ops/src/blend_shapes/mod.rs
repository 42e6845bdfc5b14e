//! Offsets of points by pose blend shapes (SMPL, eq. 8 and 9) whose reach is limited: each joint moves the points near
//! it. In Burn's own operations the products `[N, 3, R]` of all points went through memory eight times per training
//! step, which took longer than the network that chooses among the shapes (docs/performance.md).

mod autodiff;
pub mod cpu;
pub mod reference;

use super::on_cpu;
use burn::backend::{Backend, Dispatch, backend_extension, tensor::FloatTensor};
use burn::tensor::Tensor;

/// The offsets as a backend implements them; other devices run the reference. Call [`blend_shapes`] instead.
#[backend_extension(Autodiff, Flex)]
pub trait BlendShapesOps: Backend {
    /// Forward of [`blend_shapes`].
    fn blend_shapes(
        near: FloatTensor<Self>,
        by_joint: FloatTensor<Self>,
        weights: FloatTensor<Self>,
    ) -> FloatTensor<Self>;
    /// Gradients of [`blend_shapes`] to `by_joint` and `weights`, from `grad` `[N, 3]`.
    fn blend_shapes_backward(
        near: FloatTensor<Self>,
        by_joint: FloatTensor<Self>,
        weights: FloatTensor<Self>,
        grad: FloatTensor<Self>,
    ) -> (FloatTensor<Self>, FloatTensor<Self>);
}

/// Δₙ = Σₖ aₙₖ Σᵣ Gₖᵣ hₙᵣ, `[N, 3]`: `near` a `[N, K]` says how near joint k is to point n, `by_joint` G `[K, 3 R]`
/// what the turn of joint k gives each coordinate of each shape, and `weights` h `[N, R]` are the point's shares of the
/// shapes. Gradients flow to `by_joint` and `weights`.
pub fn blend_shapes(near: Tensor<2>, by_joint: Tensor<2>, weights: Tensor<2>) -> Tensor<2> {
    if on_cpu(&weights.device()) {
        Tensor::from_dispatch(Dispatch::blend_shapes(
            near.into_dispatch(),
            by_joint.into_dispatch(),
            weights.into_dispatch(),
        ))
    } else {
        reference::blend_shapes(near, by_joint, weights)
    }
}
