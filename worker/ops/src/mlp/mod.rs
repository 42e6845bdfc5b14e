//! A whole ReLU network as one operation: encoding, layers, skip, output. On a CPU a tile of
//! rows goes through all of it without leaving the cache; layer by layer, each bias, ReLU and
//! mask is a pass over memory that costs more than its arithmetic.

mod autodiff;
pub mod cpu;
mod plan;
pub mod reference;

pub use plan::{Hidden, Input, LayerShape, MlpPlan, Part};

use super::on_cpu;
use crate::Precision;
use burn::backend::{Backend, Dispatch, backend_extension, tensor::FloatTensor};
use burn::tensor::{Device, Tensor};

/// Whether networks can run in `precision` on `device`. Where they cannot, they would silently run
/// slower, or in another precision, than configured.
pub fn supports(precision: Precision, device: &Device) -> bool {
    precision == Precision::F32 || on_cpu(device)
}

/// A network as a backend implements it; other devices have the reference. Call [`mlp`] instead.
#[backend_extension(Autodiff, Flex)]
pub trait MlpOps: Backend {
    /// Forward of [`mlp`].
    fn mlp(params: FloatTensor<Self>, input: FloatTensor<Self>, plan: MlpPlan)
    -> FloatTensor<Self>;
    /// Gradients of [`mlp`] to the parameters and, if `needs_input_grad`, to the input, from
    /// `grad` `[N, plan.output]`; the latter has no rows otherwise.
    fn mlp_backward(
        params: FloatTensor<Self>,
        input: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        plan: MlpPlan,
        needs_input_grad: bool,
    ) -> (FloatTensor<Self>, FloatTensor<Self>);
}

/// The network of `plan` with the flat parameters `params` `[plan.parameters()]`, at `input`
/// `[N, plan.input.given()]` → `[N, plan.output]`. Gradients flow to both. Products are
/// computed in the plan's precision; sums, biases and the result are f32.
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
