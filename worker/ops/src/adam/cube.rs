//! The Adam update on a GPU, in place where no other tensor shares the memory.

use super::{AdamOps, AdamRates};
use crate::cube::tensors::{each, rows};
use burn::backend::tensor::FloatTensor;
use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;

impl AdamOps for CubeBackend {
    fn adam_update(
        param: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        moment_1: FloatTensor<Self>,
        moment_2: FloatTensor<Self>,
        rates: AdamRates,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        update(param, grad, moment_1, moment_2, rates)
    }
}

/// See [`super::update`].
fn update(
    param: CubeTensor,
    grad: CubeTensor,
    moment_1: CubeTensor,
    moment_2: CubeTensor,
    rates: AdamRates,
) -> (CubeTensor, CubeTensor, CubeTensor) {
    let (param, grad) = (own(param), rows(grad));
    let (moment_1, moment_2) = (own(moment_1), own(moment_2));
    let client = param.client.clone();
    let numbers = param.meta.num_elements();
    if numbers > 0 {
        let (count, dim) = each(&client, numbers);
        adam_step::launch(
            &client,
            count,
            dim,
            param.clone().into_buffer_arg(),
            grad.into_buffer_arg(),
            moment_1.clone().into_buffer_arg(),
            moment_2.clone().into_buffer_arg(),
            rates.rate,
            rates.beta_1,
            rates.beta_2,
            rates.epsilon,
        );
    }
    (param, moment_1, moment_2)
}

/// A tensor that may be written: itself, or a copy when it is shared.
fn own(tensor: CubeTensor) -> CubeTensor {
    let tensor = rows(tensor);
    if tensor.can_mut() {
        tensor
    } else {
        tensor.copy()
    }
}

/// m ← β₁ m + (1 − β₁) g, v ← β₂ v + (1 − β₂) g², p ← p − η m / (√v + ε). A thread per number.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
fn adam_step(
    param: &mut [f32],
    grad: &[f32],
    moment_1: &mut [f32],
    moment_2: &mut [f32],
    rate: f32,
    beta_1: f32,
    beta_2: f32,
    epsilon: f32,
) {
    let i = ABSOLUTE_POS;
    if i >= param.len() {
        terminate!();
    }
    let g = grad[i];
    let m = beta_1 * moment_1[i] + (1.0 - beta_1) * g;
    let v = beta_2 * moment_2[i] + (1.0 - beta_2) * g * g;
    moment_1[i] = m;
    moment_2[i] = v;
    param[i] -= rate * m / (f32::sqrt(v) + epsilon);
}
