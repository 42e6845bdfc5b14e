//! The softmax over bones on CPU threads: blocks of nodes whose columns are read row by row, in loops
//! that the compiler vectorizes.

use super::BoneSoftmaxOps;
use crate::exponential::exp_of_negative;
use crate::flex::tensor;
use crate::form::{Form, Work, multiply_add};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Flex, TensorMetadata};
use rayon::prelude::*;

/// Nodes per block: their columns of 25 rows stay in the second-level cache.
const BLOCK: usize = 1024;

impl BoneSoftmaxOps for Flex {
    fn bone_softmax(logits: FloatTensor<Self>, log_prior: FloatTensor<Self>) -> FloatTensor<Self> {
        let [rows, nodes] = logits.shape().dims();
        let [logits, log_prior] = [logits, log_prior].map(|tensor| tensor.to_contiguous());
        let weights = forward(logits.storage(), log_prior.storage(), nodes);
        tensor(weights, [rows, nodes])
    }

    fn bone_softmax_backward(
        weights: FloatTensor<Self>,
        grad: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let [rows, nodes] = weights.shape().dims();
        let [weights, grad] = [weights, grad].map(|tensor| tensor.to_contiguous());
        let to_logits = backward(weights.storage(), grad.storage(), nodes);
        tensor(to_logits, [rows, nodes])
    }
}

/// Weights `[K + 1, V]` as in [`super::bone_softmax`], of V = `nodes` nodes.
///
/// # Panics
/// If the sizes differ or are not a multiple of `nodes`.
pub fn forward(logits: &[f32], log_prior: &[f32], nodes: usize) -> Vec<f32> {
    by_blocks(logits, log_prior, nodes, |from, output| {
        Form::best().run(Softmax { from, output });
    })
}

/// Gradient to the logits `[K + 1, V]` from `weights` and the gradient to them.
///
/// # Panics
/// If the sizes differ or are not a multiple of `nodes`.
pub fn backward(weights: &[f32], grad: &[f32], nodes: usize) -> Vec<f32> {
    by_blocks(weights, grad, nodes, |from, output| {
        Form::best().run(SoftmaxBackward { from, output });
    })
}

/// A block of nodes of all rows of two inputs.
struct Inputs<'a> {
    pair: [&'a [f32]; 2],
    nodes: usize,
    first: usize,
}

impl Inputs<'_> {
    /// `count` numbers of one row of both inputs.
    #[inline(always)]
    fn row(&self, row: usize, count: usize) -> (&[f32], &[f32]) {
        let start = row * self.nodes + self.first;
        let [one, other] = self.pair;
        (&one[start..][..count], &other[start..][..count])
    }
}

/// Fills a result of the size of both inputs, block by block; `work` gets the rows of a block.
fn by_blocks(
    one: &[f32],
    other: &[f32],
    nodes: usize,
    work: impl Fn(Inputs<'_>, &mut [&mut [f32]]) + Sync,
) -> Vec<f32> {
    assert!(
        one.len() == other.len() && one.len().is_multiple_of(nodes.max(1)),
        "{} and {} numbers for {nodes} nodes",
        one.len(),
        other.len()
    );
    let mut output = vec![0f32; one.len()];
    let mut blocks: Vec<Vec<&mut [f32]>> = Vec::new();
    blocks.resize_with(nodes.div_ceil(BLOCK), Vec::new);
    for row in output.chunks_mut(nodes.max(1)) {
        for (block, part) in blocks.iter_mut().zip(row.chunks_mut(BLOCK)) {
            block.push(part);
        }
    }
    blocks.par_iter_mut().enumerate().for_each(|(block, rows)| {
        let inputs = Inputs {
            pair: [one, other],
            nodes,
            first: block * BLOCK,
        };
        work(inputs, rows);
    });
    output
}

/// Writes the softmax of the sum of both inputs.
struct Softmax<'a, 'b> {
    from: Inputs<'a>,
    output: &'a mut [&'b mut [f32]],
}

impl Work for Softmax<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let count = self.output.first().map_or(0, |row| row.len());
        // wₖ = exp(xₖ − max x) / Σ exp(xⱼ − max x) with x = logits + log prior
        let mut largest = [f32::NEG_INFINITY; BLOCK];
        let largest = &mut largest[..count];
        for (row, output) in self.output.iter_mut().enumerate() {
            let (logits, prior) = self.from.row(row, count);
            for i in 0..count {
                let sum = logits[i] + prior[i];
                output[i] = sum;
                // Unlike max, this keeps a NaN of the first row, so that it stays visible.
                largest[i] = if sum > largest[i] { sum } else { largest[i] };
            }
        }
        let mut total = [0f32; BLOCK];
        let total = &mut total[..count];
        for output in self.output.iter_mut() {
            for i in 0..count {
                let share = exp_of_negative::<FMA>(output[i] - largest[i]);
                output[i] = share;
                total[i] += share;
            }
        }
        for value in total.iter_mut() {
            *value = 1.0 / *value;
        }
        for output in self.output.iter_mut() {
            for i in 0..count {
                output[i] *= total[i];
            }
        }
    }
}

/// Writes the gradient to the logits, wₖ (gₖ − Σ wⱼ gⱼ), for weights w and the gradient g to them.
struct SoftmaxBackward<'a, 'b> {
    from: Inputs<'a>,
    output: &'a mut [&'b mut [f32]],
}

impl Work for SoftmaxBackward<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let count = self.output.first().map_or(0, |row| row.len());
        let mut mean = [0f32; BLOCK];
        let mean = &mut mean[..count];
        for row in 0..self.output.len() {
            let (weights, grad) = self.from.row(row, count);
            for i in 0..count {
                mean[i] = multiply_add::<FMA>(weights[i], grad[i], mean[i]);
            }
        }
        for (row, output) in self.output.iter_mut().enumerate() {
            let (weights, grad) = self.from.row(row, count);
            for i in 0..count {
                output[i] = weights[i] * (grad[i] - mean[i]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_prior_of_zero_stays_zero_and_sums_are_one() {
        let nodes = BLOCK + 3;
        let rows = 4;
        let logits: Vec<f32> = (0..rows * nodes)
            .map(|i| ((i * 37 % 101) as f32 - 50.0) * 2.0)
            .collect();
        let mut prior = vec![0.0f32; rows * nodes];
        prior[nodes..2 * nodes].fill(f32::NEG_INFINITY);
        let weights = forward(&logits, &prior, nodes);
        for node in 0..nodes {
            let sum: f32 = (0..rows).map(|row| weights[row * nodes + node]).sum();
            assert!((sum - 1.0).abs() < 1e-6, "node {node}: {sum}");
            assert_eq!(weights[nodes + node], 0.0);
        }
        assert!(forward(&[], &[], 0).is_empty());
    }
}
