//! The Adam update on CPU threads, in place.

use super::AdamRates;
use rayon::prelude::*;

/// Numbers a task: 4 arrays of 32 KiB stay in the L2 cache.
const BLOCK: usize = 8192;

/// See [`super::update`].
pub fn update(
    param: &mut [f32],
    grad: &[f32],
    moment_1: &mut [f32],
    moment_2: &mut [f32],
    rates: AdamRates,
) {
    let blocks = param
        .par_chunks_mut(BLOCK)
        .zip(grad.par_chunks(BLOCK))
        .zip(moment_1.par_chunks_mut(BLOCK))
        .zip(moment_2.par_chunks_mut(BLOCK));
    blocks.for_each(|(((param, grad), moment_1), moment_2)| {
        for (((p, g), m), v) in param.iter_mut().zip(grad).zip(moment_1).zip(moment_2) {
            *m = rates.beta_1 * *m + (1.0 - rates.beta_1) * g;
            *v = rates.beta_2 * *v + (1.0 - rates.beta_2) * g * g;
            *p -= rates.rate * *m / (v.sqrt() + rates.epsilon);
        }
    });
}
