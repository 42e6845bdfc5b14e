//! A whole multilayer perceptron with ReLU as one operation: encoding, layers, skip, output. On a CPU a tile of
//! rows goes through all of it without leaving the cache; layer by layer, each bias, ReLU and
//! mask would be a pass over memory that costs more than its arithmetic.

mod autodiff;
pub mod cpu;
mod plan;
pub mod reference;

pub use plan::{Hidden, Input, LayerShape, MlpPlan, Part};

use super::on_cpu;
use crate::Precision;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, backend_extension};
use burn::tensor::{Device, Tensor};

/// Whether networks can run in `precision` on `device`. Elsewhere, they would silently run slower than configured,
/// or in another precision.
pub fn supports(precision: Precision, device: &Device) -> bool {
    precision == Precision::F32 || on_cpu(device)
}

/// A network as a backend implements it; other devices run the reference. Call [`mlp`] instead.
#[backend_extension(Autodiff, Flex)]
pub trait MlpOps: Backend {
    /// Forward of [`mlp`].
    fn mlp(params: FloatTensor<Self>, input: FloatTensor<Self>, plan: MlpPlan)
    -> FloatTensor<Self>;
    /// Gradients of [`mlp`] to the parameters and, if `needs_input_grad`, to the input, from
    /// `grad` `[N, plan.output]`; otherwise the latter has no rows.
    fn mlp_backward(
        params: FloatTensor<Self>,
        input: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        plan: MlpPlan,
        needs_input_grad: bool,
    ) -> (FloatTensor<Self>, FloatTensor<Self>);
}

/// The result `[N, plan.output]` of the network `plan` with the flat parameters `params` `[plan.parameters()]` for
/// `input` `[N, plan.input.given()]`. Gradients flow to both. The factors of products have the plan's precision;
/// sums, biases and the result are f32.
pub fn mlp(params: Tensor<1>, input: Tensor<2>, plan: &MlpPlan) -> Tensor<2> {
    if on_cpu(&input.device()) {
        Tensor::from_dispatch(Dispatch::mlp(
            params.into_dispatch(),
            input.into_dispatch(),
            plan.clone(),
        ))
    } else {
        reference::mlp(params, input, plan)
    }
}
