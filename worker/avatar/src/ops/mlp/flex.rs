//! Unwraps the Flex backend's tensors for the `cpu` form.

use super::MlpPlan;
use super::cpu;
use crate::ops::form::Form;
use burn::backend::TensorMetadata;
use burn::tensor::TensorData;
use burn_flex::FlexTensor;

/// See [`super::mlp`].
pub fn mlp(params: FlexTensor, input: FlexTensor, plan: &MlpPlan) -> FlexTensor {
    let rows = input.shape()[0];
    let (params, input) = (params.to_contiguous(), input.to_contiguous());
    let output = cpu::forward(params.storage(), input.storage(), plan, Form::best());
    FlexTensor::from_data(TensorData::new(output, [rows, plan.output]))
}

/// Gradients to the parameters and to the input; the latter is `[0, given]` where it is not
/// asked for.
pub fn mlp_backward(
    params: FlexTensor,
    input: FlexTensor,
    grad: FlexTensor,
    plan: &MlpPlan,
    to_input: bool,
) -> (FlexTensor, FlexTensor) {
    let (params, input, grad) = (
        params.to_contiguous(),
        input.to_contiguous(),
        grad.to_contiguous(),
    );
    let (to_params, to_input) = cpu::backward(
        params.storage(),
        input.storage(),
        grad.storage(),
        plan,
        to_input,
        Form::best(),
    );
    let (count, given) = (to_params.len(), plan.input.given());
    let to_input = to_input.unwrap_or_default();
    let rows = to_input.len() / given;
    (
        FlexTensor::from_data(TensorData::new(to_params, [count])),
        FlexTensor::from_data(TensorData::new(to_input, [rows, given])),
    )
}
