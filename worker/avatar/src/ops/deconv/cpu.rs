//! What stands before and behind the matrix products: a product of kernels and volume has, for each
//! output channel, kernel node and input voxel, what that voxel gives through that node. Folding
//! adds these up where they land; unfolding is its transpose.

use super::{KERNEL, NODES, PADDING, STRIDE};
use rayon::prelude::*;
use std::ops::Range;

/// `columns` `[O, 4, 4, 4, D, D, D]` added up to `[O, 2D, 2D, 2D]`.
pub fn fold(columns: &[f32], side: usize) -> Vec<f32> {
    let (voxels, doubled) = (side.pow(3), STRIDE * side);
    let channels = columns.len() / (NODES * voxels);
    let mut output = vec![0f32; channels * doubled.pow(3)];
    output
        .par_chunks_mut(doubled.pow(3))
        .zip(columns.par_chunks(NODES * voxels))
        .for_each(|(output, columns)| {
            for (node, column) in columns.chunks_exact(voxels).enumerate() {
                let nodes = axes(node);
                each_row(nodes, side, |from, to| {
                    let (inputs, first) = landing(nodes[2], side);
                    let outputs = output[to..to + doubled][first..].iter_mut().step_by(STRIDE);
                    for (output, value) in outputs.zip(&column[from..from + side][inputs]) {
                        *output += value;
                    }
                });
            }
        });
    output
}

/// `output` `[O, 2D, 2D, 2D]` as the columns `[O, 4, 4, 4, D, D, D]` that it feeds back to.
pub fn unfold(output: &[f32], side: usize) -> Vec<f32> {
    let (voxels, doubled) = (side.pow(3), STRIDE * side);
    let channels = output.len() / doubled.pow(3);
    let mut columns = vec![0f32; channels * NODES * voxels];
    columns
        .par_chunks_mut(NODES * voxels)
        .zip(output.par_chunks(doubled.pow(3)))
        .for_each(|(columns, output)| {
            for (node, column) in columns.chunks_exact_mut(voxels).enumerate() {
                let nodes = axes(node);
                each_row(nodes, side, |from, to| {
                    let (inputs, first) = landing(nodes[2], side);
                    let outputs = output[to..to + doubled][first..].iter().step_by(STRIDE);
                    for (value, output) in column[from..from + side][inputs].iter_mut().zip(outputs)
                    {
                        *value = *output;
                    }
                });
            }
        });
    columns
}

/// z, y, x of a kernel's node.
fn axes(node: usize) -> [usize; 3] {
    [
        node / KERNEL / KERNEL,
        node / KERNEL % KERNEL,
        node % KERNEL,
    ]
}

/// The inputs along an axis of `side` whose place through kernel node `node` lies in the output, and
/// the first of these places.
fn landing(node: usize, side: usize) -> (Range<usize>, usize) {
    // Input i lands at 2i + node − 1, which must be in 0 .. 2·side.
    let first = usize::from(node < PADDING);
    let last = (STRIDE * side + PADDING - node).div_ceil(STRIDE).min(side);
    (first..last, STRIDE * first + node - PADDING)
}

/// Calls `work` with the start of each row of input voxels along x that lands in the output, and of
/// the row where it lands.
fn each_row(nodes: [usize; 3], side: usize, mut work: impl FnMut(usize, usize)) {
    let doubled = STRIDE * side;
    let (inputs, first_z) = landing(nodes[0], side);
    for (to_z, z) in (first_z..).step_by(STRIDE).zip(inputs) {
        let (inputs, first_y) = landing(nodes[1], side);
        for (to_y, y) in (first_y..).step_by(STRIDE).zip(inputs) {
            work((z * side + y) * side, (to_z * doubled + to_y) * doubled);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inputs_land_inside() {
        // Of one voxel, the two middle nodes of the kernel are seen.
        let seen: Vec<_> = (0..KERNEL).map(|node| landing(node, 1)).collect();
        assert_eq!(seen[1], (0..1, 0));
        assert_eq!(seen[2], (0..1, 1));
        assert!(seen[0].0.is_empty() && seen[3].0.is_empty());
        // Of three, the outer nodes lose one each.
        let seen: Vec<_> = (0..KERNEL).map(|node| landing(node, 3)).collect();
        assert_eq!(seen, [(1..3, 1), (0..3, 0), (0..3, 1), (0..2, 2)]);
    }
}
