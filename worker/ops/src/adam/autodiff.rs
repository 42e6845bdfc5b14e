//! The Adam update on a differentiating backend: no gradients flow through it.

use super::{AdamOps, AdamRates};
use crate::autodiff::constants;
use burn::backend::Autodiff;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;

impl<B: AdamOps, C: CheckpointStrategy> AdamOps for Autodiff<B, C> {
    fn adam_update(
        param: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        moment_1: FloatTensor<Self>,
        moment_2: FloatTensor<Self>,
        rates: AdamRates,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        constants::<B, C, _, _>(
            [param, grad, moment_1, moment_2],
            |[param, grad, moment_1, moment_2]| {
                B::adam_update(param, grad, moment_1, moment_2, rates).into()
            },
        )
        .into()
    }
}
