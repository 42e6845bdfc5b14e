//! Features of points, block by block.

use super::BLOCK;
use super::cells::{Cells, LANES, Points};
use crate::form::{Form, Work, multiply_add};
use crate::hash::HashGrid;
use rayon::prelude::*;

/// See [`super::forward()`]; the grid was checked.
pub(super) fn forward<const F: usize>(
    form: Form,
    table: &[f32],
    points: &[f32],
    grid: &HashGrid,
) -> Vec<f32> {
    let width = grid.width();
    let mut output = vec![0f32; points.len() / 3 * width];
    output
        .par_chunks_mut(BLOCK * width)
        .zip(points.par_chunks(BLOCK * 3))
        .for_each(|(output, points)| {
            form.run(Block::<F> {
                table,
                points,
                output,
                grid,
            });
        });
    output
}

/// The features of a block of points.
pub(super) struct Block<'a, const F: usize> {
    pub table: &'a [f32],
    /// `[n, 3]`.
    pub points: &'a [f32],
    /// `[n, L F]`.
    pub output: &'a mut [f32],
    pub grid: &'a HashGrid,
}

impl<const F: usize> Work for Block<'_, F> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let width = self.grid.width();
        let (table, _) = self.table.as_chunks::<F>();
        let groups: Vec<Points> = self
            .points
            .chunks(3 * LANES)
            .map(|points| Points::new(points, self.grid))
            .collect();
        for (l, level) in self.grid.levels.iter().enumerate() {
            let rows = &table[level.offset..level.offset + level.rows];
            for (group, output) in groups.iter().zip(self.output.chunks_mut(LANES * width)) {
                let cells = Cells::new(&group.unit, level);
                let weights = cells.weights();
                for (lane, output) in output.chunks_exact_mut(width).enumerate() {
                    // Σ wₖ table[rowₖ] over the corners k
                    let mut sum = [0f32; F];
                    for (corner, weights) in cells.rows.iter().zip(&weights) {
                        // SAFETY: `Cells` computes rows of its level only, which `check` found to
                        // be complete, and `rows` are all of them.
                        let row = unsafe { rows.get_unchecked(corner[lane] as usize) };
                        for f in 0..F {
                            sum[f] = multiply_add::<FMA>(weights[lane], row[f], sum[f]);
                        }
                    }
                    output[l * F..(l + 1) * F].copy_from_slice(&sum);
                }
            }
        }
    }
}
