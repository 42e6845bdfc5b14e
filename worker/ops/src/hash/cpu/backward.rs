//! Gradients to the table and the points, level by level.

use super::BLOCK;
use super::cells::{Cells, LANES, Lanes, Points};
use crate::form::{Form, Work, multiply_add};
use crate::hash::{HashGrid, Level};
use rayon::prelude::*;

/// See [`super::backward()`]; the grid was checked.
pub(super) fn backward<const F: usize>(
    form: Form,
    table: &[f32],
    points: &[f32],
    grad: &[f32],
    grid: &HashGrid,
    needs_points_grad: bool,
) -> (Vec<f32>, Vec<f32>) {
    let width = grid.width();
    let blocks: Vec<ActivePoints> = points
        .par_chunks(BLOCK * 3)
        .zip(grad.par_chunks(BLOCK * width))
        .map(|(points, grad)| form.run(Gather { points, grad, grid }))
        .collect();
    let groups: usize = blocks.iter().map(|block| block.points.len()).sum();

    let mut to_table = vec![0f32; table.len()];
    let mut rest = to_table.as_mut_slice();
    let tasks: Vec<_> = grid
        .levels
        .iter()
        .enumerate()
        .map(|(l, level)| {
            let (to_rows, after) = std::mem::take(&mut rest).split_at_mut(level.rows * F);
            rest = after;
            (l, level, to_rows)
        })
        .collect();
    let to_unit: Vec<Vec<[Lanes; 3]>> = tasks
        .into_par_iter()
        .map(|(l, level, to_rows)| {
            let rows = &table[level.offset * F..(level.offset + level.rows) * F];
            let mut to_unit = Vec::with_capacity(if needs_points_grad { groups } else { 0 });
            let scatter = Scatter::<F> {
                rows: rows.as_chunks().0,
                to_rows: to_rows.as_chunks_mut().0,
                to_unit: needs_points_grad.then_some(&mut to_unit),
                blocks: &blocks,
                width,
                level,
                l,
            };
            form.run(scatter);
            to_unit
        })
        .collect();
    if !needs_points_grad {
        return (to_table, Vec::new());
    }

    let mut to_points = vec![0f32; points.len()];
    let mut first = 0;
    let firsts: Vec<usize> = blocks
        .iter()
        .map(|block| {
            let this = first;
            first += block.points.len();
            this
        })
        .collect();
    to_points
        .par_chunks_mut(BLOCK * 3)
        .zip(blocks.par_iter().zip(&firsts))
        .for_each(|(to_points, (block, first))| {
            for (k, at) in block.indices.iter().enumerate() {
                let (group, lane) = (k / LANES, k % LANES);
                for a in 0..3 {
                    let levels = to_unit.iter().map(|to| to[first + group][a][lane]);
                    to_points[3 * *at as usize + a] =
                        block.points[group].slope[a][lane] * levels.sum::<f32>();
                }
            }
        });
    (to_table, to_points)
}

/// The points of a block whose gradient is not 0. That of hidden samples is 0.
pub(super) struct ActivePoints {
    /// Indices of the points in the block.
    pub indices: Vec<u16>,
    /// Sixteen at a time.
    pub points: Vec<Points>,
    /// `[groups, L F]` gradients, 0 in lanes without a point.
    pub grad: Vec<Lanes>,
}

/// Selects the points of a block whose gradient is not 0. `points` `[n, 3]` and `grad` `[n, L F]`
/// are those of the block.
pub(super) struct Gather<'a> {
    pub points: &'a [f32],
    pub grad: &'a [f32],
    pub grid: &'a HashGrid,
}

impl Work for Gather<'_> {
    type Output = ActivePoints;

    #[inline(always)]
    fn run<const FMA: bool>(self) -> ActivePoints {
        let width = self.grid.width();
        let indices: Vec<u16> = self
            .grad
            .chunks_exact(width)
            .zip(0u16..)
            .filter(|(row, _)| row.iter().fold(false, |any, g| any | (*g != 0.0)))
            .map(|(_, index)| index)
            .collect();
        let groups = indices.len().div_ceil(LANES);
        let mut points = Vec::with_capacity(groups);
        let mut grad = vec![[0f32; LANES]; groups * width];
        for (indices, grad) in indices.chunks(LANES).zip(grad.chunks_exact_mut(width)) {
            let mut numbers = [[0f32; 3]; LANES];
            for (lane, index) in indices.iter().enumerate() {
                let at = *index as usize;
                numbers[lane].copy_from_slice(&self.points[3 * at..3 * at + 3]);
                let row = &self.grad[width * at..width * (at + 1)];
                for (lanes, value) in grad.iter_mut().zip(row) {
                    lanes[lane] = *value;
                }
            }
            points.push(Points::new(numbers.as_flattened(), self.grid));
        }
        ActivePoints {
            indices,
            points,
            grad,
        }
    }
}

/// The backward pass of one level over all blocks, in their order.
pub(super) struct Scatter<'a, const F: usize> {
    /// The rows of the level in the table.
    pub rows: &'a [[f32; F]],
    /// The gradients to `rows`, of the same length.
    pub to_rows: &'a mut [[f32; F]],
    /// Gradients to the positions in the cube, group by group, if they are needed.
    pub to_unit: Option<&'a mut Vec<[Lanes; 3]>>,
    pub blocks: &'a [ActivePoints],
    /// L F.
    pub width: usize,
    pub level: &'a Level,
    /// Index of the level.
    pub l: usize,
}

impl<const F: usize> Work for Scatter<'_, F> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        // Checked here, since look-ups are not bounds-checked.
        assert!(
            self.rows.len() == self.level.rows && self.to_rows.len() == self.level.rows,
            "the rows of one level"
        );
        let cells_per_axis = self.level.cells as f32;
        let mut to_unit = self.to_unit;
        for block in self.blocks {
            let mut left = block.indices.len();
            let groups = block.points.iter().zip(block.grad.chunks_exact(self.width));
            for (points, grad) in groups {
                let cells = Cells::new(&points.unit, self.level);
                let weights = cells.weights();
                let grad = &grad[self.l * F..(self.l + 1) * F];
                let lanes = left.min(LANES);
                left -= lanes;
                for lane in 0..lanes {
                    let grad: [f32; F] = std::array::from_fn(|f| grad[f][lane]);
                    for (rows, weights) in cells.rows.iter().zip(&weights) {
                        // SAFETY: `Cells` computes rows of its level only, which `check` found to
                        // be complete, and `to_rows` are all of them.
                        let row = unsafe { self.to_rows.get_unchecked_mut(rows[lane] as usize) };
                        // ∂L/∂table[rowₖ] += wₖ ∂L/∂feature
                        for f in 0..F {
                            row[f] = multiply_add::<FMA>(weights[lane], grad[f], row[f]);
                        }
                    }
                }
                let Some(to_unit) = &mut to_unit else {
                    continue;
                };
                let mut to_corners = [[0f32; LANES]; 8];
                for lane in 0..lanes {
                    let grad: [f32; F] = std::array::from_fn(|f| grad[f][lane]);
                    for (rows, to_corners) in cells.rows.iter().zip(&mut to_corners) {
                        // SAFETY: as above; `rows` has the length of `to_rows`.
                        let row = unsafe { self.rows.get_unchecked(rows[lane] as usize) };
                        // ∂L/∂wₖ = ∂L/∂feature · table[rowₖ]
                        let mut dot = 0.0;
                        for f in 0..F {
                            dot = multiply_add::<FMA>(grad[f], row[f], dot);
                        }
                        to_corners[lane] = dot;
                    }
                }
                let to_cell = cells.position_gradient(&to_corners);
                to_unit.push(to_cell.map(|lanes| lanes.map(|slope| slope * cells_per_axis)));
            }
        }
    }
}
