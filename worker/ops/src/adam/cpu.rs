//! The Adam update on CPU threads, in place.

use super::{AdamOps, AdamRates};
use burn::backend::Flex;
use burn::backend::tensor::FloatTensor;
use rayon::prelude::*;

/// Numbers per task: 4 arrays of 32 KiB stay in the second-level cache.
const BLOCK: usize = 8192;

impl AdamOps for Flex {
    fn adam_update(
        param: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        moment_1: FloatTensor<Self>,
        moment_2: FloatTensor<Self>,
        rates: AdamRates,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        let grad = grad.to_contiguous();
        // The original handles are dropped here: a write copies the numbers while a second handle exists.
        let contiguous = |tensor: FloatTensor<Self>| tensor.to_contiguous();
        let [mut param, mut moment_1, mut moment_2] = [param, moment_1, moment_2].map(contiguous);
        // `storage_mut` copies first when another tensor still shares the memory.
        update(
            param.storage_mut(),
            grad.storage(),
            moment_1.storage_mut(),
            moment_2.storage_mut(),
            rates,
        );
        (param, moment_1, moment_2)
    }
}

/// See [`super::update`].
///
/// # Panics
/// If the lengths differ.
pub fn update(
    param: &mut [f32],
    grad: &[f32],
    moment_1: &mut [f32],
    moment_2: &mut [f32],
    rates: AdamRates,
) {
    let lengths = [grad.len(), moment_1.len(), moment_2.len()];
    assert_eq!(
        lengths,
        [param.len(); 3],
        "gradient and moments of a parameter"
    );
    let blocks = param
        .par_chunks_mut(BLOCK)
        .zip(grad.par_chunks(BLOCK))
        .zip(moment_1.par_chunks_mut(BLOCK))
        .zip(moment_2.par_chunks_mut(BLOCK));
    blocks.for_each(|(((param, grad), moment_1), moment_2)| {
        for (((p, g), m), v) in param.iter_mut().zip(grad).zip(moment_1).zip(moment_2) {
            // m ← β₁ m + (1 − β₁) g, v ← β₂ v + (1 − β₂) g², p ← p − η m / (√v + ε)
            *m = rates.beta_1 * *m + (1.0 - rates.beta_1) * g;
            *v = rates.beta_2 * *v + (1.0 - rates.beta_2) * g * g;
            *p -= rates.rate * *m / (v.sqrt() + rates.epsilon);
        }
    });
}
