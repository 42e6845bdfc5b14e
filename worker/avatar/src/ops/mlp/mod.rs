//! A whole ReLU network as one operation: encoding, layers, skip, output. On a CPU a tile of
//! rows goes through all of it without leaving the cache; layer by layer, each bias, ReLU and
//! mask is a pass over memory that costs more than its arithmetic.

pub(super) mod autodiff;
pub mod cpu;
pub(super) mod flex;
mod plan;
pub mod reference;

pub use plan::{Hidden, Input, LayerShape, MlpPlan, Part};

use super::{CpuOps, on_cpu};
use crate::config::{ConfigError, Precision};
use burn::backend::Dispatch;
use burn::tensor::{Device, Tensor};

/// Whether networks can run in `precision` on `device`.
///
/// # Errors
/// When they can't: they would silently be slower, or another precision, than asked for.
pub fn check_device(precision: Precision, device: &Device) -> Result<(), ConfigError> {
    if precision == Precision::Bf16 && !on_cpu(device) {
        return Err(ConfigError::Field {
            field: "precision",
            message: "bf16 runs on the CPU only; this device needs f32".into(),
        });
    }
    Ok(())
}

/// The network of `plan` with the flat parameters `params` `[plan.parameters()]`, at `input`
/// `[N, plan.input.given()]` → `[N, plan.output]`. Gradients flow to both. Products are taken
/// in the plan's precision; sums, biases and the result are f32.
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
