//! The network on CPU threads: tiles of rows that stay in the cache from the first layer to
//! the last, with the best instructions that the machine has.
//!
//! Nothing of the forward pass is kept for the backward pass, which runs each tile again. This takes a
//! third more arithmetic and saves 8 KB per row of the paper's network. Rows whose gradient is
//! exactly zero contribute nothing and are left out before tiles are formed. Gradients to
//! parameters are summed in a number of parts that depends on the rows alone, and the sums of the parts are
//! added in a fixed order. So the result does not depend on the number of threads.

#[cfg(target_arch = "x86_64")]
mod amx;
mod arithmetic;
mod encode;
mod kernels;
mod layout;
mod memory;
mod product;
#[cfg(test)]
mod tests;
mod tile;
mod vector;
#[cfg(target_arch = "x86_64")]
mod x86;
#[cfg(target_arch = "x86_64")]
mod x86_bf16;

use super::{MlpOps, MlpPlan};
use crate::flex::tensor;
use crate::form::Form;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Flex, TensorMetadata};
use kernels::kernels;
use layout::Layout;
use memory::{Region, Words, with_scratch};
use rayon::prelude::*;
use tile::{Gradients, Rows, Tiles};

/// Largest number of parts in which gradients to parameters are summed.
const PARTS: usize = 32;
/// Smallest number of tiles per part: with fewer, the part's own sums would cost too much.
const TILES: usize = 6;

impl MlpOps for Flex {
    fn mlp(
        params: FloatTensor<Self>,
        input: FloatTensor<Self>,
        plan: MlpPlan,
    ) -> FloatTensor<Self> {
        let rows = input.shape()[0];
        let [params, input] = [params, input].map(|tensor| tensor.to_contiguous());
        let output = forward(params.storage(), input.storage(), &plan, Form::best());
        tensor(output, [rows, plan.output])
    }

    fn mlp_backward(
        params: FloatTensor<Self>,
        input: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        plan: MlpPlan,
        needs_input_grad: bool,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        let [params, input, grad] = [params, input, grad].map(|tensor| tensor.to_contiguous());
        let (to_params, to_input) = backward(
            params.storage(),
            input.storage(),
            grad.storage(),
            &plan,
            needs_input_grad,
            Form::best(),
        );
        let (count, given) = (to_params.len(), plan.input.given());
        let to_input = match to_input {
            Some(to_input) => {
                let rows = to_input.len() / given;
                tensor(to_input, [rows, given])
            }
            None => tensor(Vec::new(), [0, given]),
        };
        (tensor(to_params, [count]), to_input)
    }
}

/// The result `[N, output]` for `input` `[N, given]`, with the instructions of `form`.
///
/// # Panics
/// If the sizes do not match the plan.
pub fn forward(params: &[f32], input: &[f32], plan: &MlpPlan, form: Form) -> Vec<f32> {
    let rows = check(params, input, plan);
    let layout = Layout::new(plan, kernels(form, plan.precision));
    let packed = layout.pack(params, false);
    let tiles = Tiles::new(&layout, &packed, input, false);
    let mut output = vec![0f32; rows * layout.output];
    output
        .par_chunks_mut(tiles.rows * layout.output)
        .enumerate()
        .for_each(|(i, output)| {
            let rows = Rows::From(i * tiles.rows, output.len() / layout.output);
            with_scratch(tiles.words(), |scratch| {
                tiles.forward(rows, scratch, output);
            });
        });
    output
}

/// Gradients to the parameters and, if `needs_input_grad`, to the input `[N, given]`, from the
/// gradient `grad` `[N, output]` to the result.
///
/// # Panics
/// If the sizes do not match the plan.
pub fn backward(
    params: &[f32],
    input: &[f32],
    grad: &[f32],
    plan: &MlpPlan,
    needs_input_grad: bool,
    form: Form,
) -> (Vec<f32>, Option<Vec<f32>>) {
    let rows = check(params, input, plan);
    assert_eq!(grad.len(), rows * plan.output, "numbers of the gradient");
    let layout = Layout::new(plan, kernels(form, plan.precision));
    let given = layout.given();
    let active: Vec<u32> = grad
        .chunks_exact(layout.output)
        .enumerate()
        .filter(|(_, row)| row.iter().any(|g| *g != 0.0))
        .map(|(i, _)| i as u32)
        .collect();
    let mut input_grad = needs_input_grad.then(|| vec![0f32; input.len()]);
    if active.is_empty() {
        return (vec![0f32; params.len()], input_grad);
    }
    let packed = layout.pack(params, true);
    let tiles = Tiles::new(&layout, &packed, input, true);

    let parts = active.len().div_ceil(tiles.rows * TILES).min(PARTS);
    let share = active.len().div_ceil(tiles.rows).div_ceil(parts) * tiles.rows;
    // The gradient to the input of a part begins at its first row and ends at that of the next part.
    let mut jobs = Vec::with_capacity(parts);
    let mut rest = input_grad.as_deref_mut();
    let mut first = 0;
    for part in 0..active.len().div_ceil(share) {
        let picked = &active[part * share..active.len().min((part + 1) * share)];
        let next = active
            .get((part + 1) * share)
            .map_or(rows, |row| *row as usize);
        let own = rest.take().map(|slice| {
            let (own, after) = slice.split_at_mut((next - first) * given);
            rest = Some(after);
            own
        });
        jobs.push((picked, first, own));
        first = next;
    }
    let sums: Vec<Words> = jobs
        .into_par_iter()
        .with_max_len(1)
        .map(|(picked, first, own)| {
            let mut sums = Words::zeroed(layout.gradients);
            let mut gradients = Gradients {
                params: Region::new(sums.floats()),
                input: own,
                first,
            };
            with_scratch(tiles.words(), |scratch| {
                for rows in picked.chunks(tiles.rows) {
                    tiles.backward(Rows::Picked(rows), grad, scratch, &mut gradients);
                }
            });
            sums
        })
        .collect();
    (layout.unpack(&added(sums), params.len()), input_grad)
}

/// The number of rows of `input`. The products rely on the sizes that are checked here.
///
/// # Panics
/// If a size is wrong.
fn check(params: &[f32], input: &[f32], plan: &MlpPlan) -> usize {
    let (given, output) = (plan.input.given(), plan.output);
    assert!(
        given > 0 && output > 0 && plan.hidden.iter().all(|layer| layer.width > 0),
        "a layer, input or output of width 0"
    );
    assert_eq!(params.len(), plan.parameters(), "numbers of the parameters");
    assert_eq!(input.len() % given, 0, "numbers of the input: whole rows");
    let rows = input.len() / given;
    assert!(
        u32::try_from(rows).is_ok(),
        "more rows than 32 bits can count"
    );
    rows
}

/// The sum of the parts' sums, added in their order.
fn added(sums: Vec<Words>) -> Vec<f32> {
    let (first, others) = sums.split_first().expect("at least one part");
    let mut total = first.read_floats().to_vec();
    const CHUNK: usize = 4096;
    total
        .par_chunks_mut(CHUNK)
        .enumerate()
        .for_each(|(i, total)| {
            for other in others {
                let other = &other.read_floats()[i * CHUNK..];
                for (total, other) in total.iter_mut().zip(other) {
                    *total += other;
                }
            }
        });
    total
}
