//! One Adam update in one pass over memory. Burn's own takes about ten, which on tables of
//! a million numbers costs more than the rest of the step.

pub mod cpu;
#[cfg(feature = "gpu")]
pub(super) mod cube;
pub mod reference;

use super::{AvatarOps, has_own_form};
use burn::backend::Dispatch;
use burn::tensor::Tensor;

/// The scalars of an update.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdamRates {
    /// Learning rate with both bias corrections in it.
    pub rate: f32,
    /// Decay of the first moment.
    pub beta_1: f32,
    /// Decay of the second moment.
    pub beta_2: f32,
    /// Added to the root of the second moment, already divided by its bias correction.
    pub epsilon: f32,
}

impl AdamRates {
    /// For the update number `time`, from 1 on.
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

/// Parameter and moments after the update.
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
