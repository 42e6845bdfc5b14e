//! The Adam update in Burn's own tensor operations, which the tests compare the other forms with.

use super::AdamRates;
use burn::tensor::Tensor;

/// See [`super::update`].
pub fn update<const D: usize>(
    param: Tensor<D>,
    grad: Tensor<D>,
    moment_1: Tensor<D>,
    moment_2: Tensor<D>,
    rates: AdamRates,
) -> (Tensor<D>, Tensor<D>, Tensor<D>) {
    let moment_1 = moment_1 * rates.beta_1 + grad.clone() * (1.0 - rates.beta_1);
    let moment_2 = moment_2 * rates.beta_2 + grad.square() * (1.0 - rates.beta_2);
    let param = param - moment_1.clone() * rates.rate / (moment_2.clone().sqrt() + rates.epsilon);
    (param, moment_1, moment_2)
}
