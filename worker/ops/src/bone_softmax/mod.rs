//! The motion weights at each node of a grid: softmax over bones of logits + log prior (HumanNeRF, arXiv
//! 2201.04127, whose prior is a Gaussian around each bone). Burn's softmax over the first of two
//! axes reads memory column by column, which took as long as the rest of a training step.

mod autodiff;
pub mod cpu;
pub mod reference;

use super::on_cpu;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, backend_extension};
use burn::tensor::Tensor;

/// The softmax as a backend implements it; other devices run the reference. Call
/// [`bone_softmax`] instead.
#[backend_extension(Autodiff, Flex)]
pub trait BoneSoftmaxOps: Backend {
    /// Forward of [`bone_softmax`].
    fn bone_softmax(logits: FloatTensor<Self>, log_prior: FloatTensor<Self>) -> FloatTensor<Self>;
    /// Gradient of [`bone_softmax`] to the logits, from its result and the gradient to it.
    fn bone_softmax_backward(
        weights: FloatTensor<Self>,
        grad: FloatTensor<Self>,
    ) -> FloatTensor<Self>;
}

/// `logits` `[K + 1, V]` and `log_prior` `[K + 1, V]` → weights `[K + 1, V]`, which sum to 1 at each of the V nodes.
/// A `log_prior` of −∞ gives a weight of 0. Gradients flow to the logits.
pub fn bone_softmax(logits: Tensor<2>, log_prior: Tensor<2>) -> Tensor<2> {
    if on_cpu(&logits.device()) {
        Tensor::from_dispatch(Dispatch::bone_softmax(
            logits.into_dispatch(),
            log_prior.into_dispatch(),
        ))
    } else {
        reference::bone_softmax(logits, log_prior)
    }
}
