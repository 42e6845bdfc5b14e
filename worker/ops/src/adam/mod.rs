//! An Adam update (Kingma and Ba, arXiv 1412.6980, algorithm 1) in one pass over memory. Burn's own takes about
//! ten passes, which on tables of a million numbers costs more than the rest of the step.

mod autodiff;
pub mod cpu;
#[cfg(feature = "gpu")]
mod cube;
pub mod reference;

use super::has_own_form;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, backend_extension};
use burn::tensor::Tensor;

/// The scalars of an update.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdamRates {
    /// Learning rate, corrected for the bias of both moments.
    pub rate: f32,
    /// Decay of the first moment.
    pub beta_1: f32,
    /// Decay of the second moment.
    pub beta_2: f32,
    /// Added to the root of the second moment: ε times the root of that moment's bias correction.
    pub epsilon: f32,
}

impl AdamRates {
    /// The scalars of the update at the step `time`, counted from 1.
    pub fn new(learning_rate: f64, beta_1: f64, beta_2: f64, epsilon: f64, time: usize) -> Self {
        let time = time.min(i32::MAX as usize) as i32;
        let root = (1.0 - beta_2.powi(time)).sqrt();
        Self {
            rate: (learning_rate * root / (1.0 - beta_1.powi(time))) as f32,
            beta_1: beta_1 as f32,
            beta_2: beta_2 as f32,
            // m̂/(√v̂ + ε) = (m/c₁)·√c₂/(√v + ε·√c₂)
            epsilon: (epsilon * root) as f32,
        }
    }
}

/// The Adam update as a backend implements it. Call [`update`] instead, which chooses the form for
/// the tensors' device.
#[backend_extension(Autodiff, Flex, Cube: cfg(feature = "gpu"), Fusion: cfg(feature = "gpu"))]
pub trait AdamOps: Backend {
    /// See [`update`].
    #[fusion(meta = |param, _, moment_1, moment_2, _| {
        (param.clone(), moment_1.clone(), moment_2.clone())
    })]
    fn adam_update(
        param: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        moment_1: FloatTensor<Self>,
        moment_2: FloatTensor<Self>,
        rates: AdamRates,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>);
}

/// The parameter and both moments after the update. All four tensors have the same shape.
pub fn update<const D: usize>(
    param: Tensor<D>,
    grad: Tensor<D>,
    moment_1: Tensor<D>,
    moment_2: Tensor<D>,
    rates: AdamRates,
) -> (Tensor<D>, Tensor<D>, Tensor<D>) {
    if has_own_form(&param.device()) {
        let (param, moment_1, moment_2) = Dispatch::adam_update(
            param.into_dispatch(),
            grad.into_dispatch(),
            moment_1.into_dispatch(),
            moment_2.into_dispatch(),
            rates,
        );
        (
            Tensor::from_dispatch(param),
            Tensor::from_dispatch(moment_1),
            Tensor::from_dispatch(moment_2),
        )
    } else {
        reference::update(param, grad, moment_1, moment_2, rates)
    }
}
