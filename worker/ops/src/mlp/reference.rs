//! The network in Burn's own tensor operations, which the tests compare the other forms with.

use super::{Input, MlpPlan, Part};
use crate::Precision;
use crate::encode::frequencies;
use burn::tensor::activation::relu;
use burn::tensor::{DType, Tensor};

/// See [`super::mlp`]. With [`Precision::Bf16`] the other forms also round
/// gradients to layers' results; this one does not.
pub fn mlp(params: Tensor<1>, input: Tensor<2>, plan: &MlpPlan) -> Tensor<2> {
    let input = match &plan.input {
        Input::Features { .. } => input,
        Input::Frequencies { bands, raw } => {
            let encoded = frequencies(input.clone(), bands);
            if *raw {
                Tensor::cat(vec![input, encoded], 1)
            } else {
                encoded
            }
        }
    };
    let input = factor(input, plan.precision);
    let layers = plan.layers();
    let mut x = input.clone();
    for (l, layer) in layers.iter().enumerate() {
        let columns = layer.columns;
        let bias = params.clone().narrow(0, layer.bias, columns);
        let product = |part: &Part| {
            let weight = params
                .clone()
                .narrow(0, part.weight, part.width * columns)
                .reshape([part.width, columns]);
            let from = if part.input { &input } else { &x };
            from.clone().matmul(factor(weight, plan.precision))
        };
        let products = layer.parts.iter().map(product);
        let sum = products.reduce(|sum, product| sum + product);
        let y = sum.expect("a layer multiplies something") + bias.unsqueeze::<2>();
        x = if l + 1 < layers.len() {
            factor(relu(y), plan.precision)
        } else {
            y
        };
    }
    x
}

/// `tensor` as a factor of products in `precision`.
fn factor(tensor: Tensor<2>, precision: Precision) -> Tensor<2> {
    match precision {
        Precision::F32 => tensor,
        Precision::Bf16 => {
            // Straight-through estimator: the gradient is not rounded with the value. The
            // difference is exact in f32, and so is the sum.
            let value = tensor.clone().detach();
            let rounded = value.clone().cast(DType::BF16).cast(DType::F32);
            tensor + (rounded - value)
        }
    }
}
