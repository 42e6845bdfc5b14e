//! The hash grid on CPU threads: forward over blocks of points; backward over levels, whose
//! rows are disjoint, so that sums come out in one order whatever the number of threads.

use super::{HashGrid, Level};
use rayon::prelude::*;

const BLOCK: usize = 256;

/// The cell of a point at one level, and whether each axis is inside the box (a point outside
/// is moved to its border and has no gradient along that axis).
#[inline(always)]
fn cell(point: &[f32], grid: &HashGrid, level: &Level) -> ([u32; 3], [f32; 3], [f32; 3]) {
    let (mut low, mut part, mut slope) = ([0u32; 3], [0f32; 3], [0f32; 3]);
    for a in 0..3 {
        let raw = (point[a] - grid.min[a]) / grid.side;
        let unit = raw.clamp(0.0, 1.0);
        let x = unit * level.cells as f32;
        // `as` saturates and takes a NaN to 0.
        low[a] = (x as u32).min(level.cells - 1);
        part[a] = x - low[a] as f32;
        slope[a] = if raw == unit {
            level.cells as f32 / grid.side
        } else {
            0.0
        };
    }
    (low, part, slope)
}

#[inline(always)]
fn corners(
    low: [u32; 3],
    part: [f32; 3],
    level: &Level,
    mut visit: impl FnMut(usize, [f32; 3], [f32; 3]),
) {
    for corner in 0..8u32 {
        let bit = [corner & 1, corner >> 1 & 1, corner >> 2];
        let row = level.row(std::array::from_fn(|a| low[a] + bit[a]));
        let u = std::array::from_fn(|a| if bit[a] == 1 { part[a] } else { 1.0 - part[a] });
        let s = std::array::from_fn(|a| if bit[a] == 1 { 1.0 } else { -1.0 });
        visit(row, u, s);
    }
}

/// Calls the form made for the grid's number of features.
macro_rules! by_features {
    ($grid:expr, $function:ident ( $($argument:expr),* )) => {
        match $grid.features {
            1 => $function::<1>($($argument),*),
            2 => $function::<2>($($argument),*),
            4 => $function::<4>($($argument),*),
            _ => $function::<8>($($argument),*),
        }
    };
}

/// `[N, L F]` as in [`super::encode`].
pub fn forward(table: &[f32], points: &[f32], grid: &HashGrid) -> Vec<f32> {
    by_features!(grid, forward_of(table, points, grid))
}

/// Gradients to the table (same shape) and the points `[N, 3]`.
pub fn backward(
    table: &[f32],
    points: &[f32],
    grad: &[f32],
    grid: &HashGrid,
) -> (Vec<f32>, Vec<f32>) {
    by_features!(grid, backward_of(table, points, grad, grid))
}

fn forward_of<const F: usize>(table: &[f32], points: &[f32], grid: &HashGrid) -> Vec<f32> {
    let width = grid.width();
    let (table, _) = table.as_chunks::<F>();
    let mut output = vec![0f32; points.len() / 3 * width];
    output
        .par_chunks_mut(BLOCK * width)
        .zip(points.par_chunks(BLOCK * 3))
        .for_each(|(output, points)| {
            for (l, level) in grid.levels.iter().enumerate() {
                let rows = &table[level.offset..level.offset + level.rows];
                for (out, point) in output.chunks_exact_mut(width).zip(points.chunks_exact(3)) {
                    let (low, part, _) = cell(point, grid, level);
                    let mut sum = [0f32; F];
                    corners(low, part, level, |row, u, _| {
                        let share = u[0] * u[1] * u[2];
                        for f in 0..F {
                            sum[f] += share * rows[row][f];
                        }
                    });
                    out[l * F..(l + 1) * F].copy_from_slice(&sum);
                }
            }
        });
    output
}

fn backward_of<const F: usize>(
    table: &[f32],
    points: &[f32],
    grad: &[f32],
    grid: &HashGrid,
) -> (Vec<f32>, Vec<f32>) {
    let width = grid.width();
    let mut to_table = vec![0f32; table.len()];
    let (table, _) = table.as_chunks::<F>();

    let mut to_points = vec![0f32; points.len()];
    to_points
        .par_chunks_mut(BLOCK * 3)
        .zip(points.par_chunks(BLOCK * 3))
        .zip(grad.par_chunks(BLOCK * width))
        .for_each(|((to_points, points), grad)| {
            for (l, level) in grid.levels.iter().enumerate() {
                let rows = &table[level.offset..level.offset + level.rows];
                for ((to, point), grad) in to_points
                    .chunks_exact_mut(3)
                    .zip(points.chunks_exact(3))
                    .zip(grad.chunks_exact(width))
                {
                    let grad = &grad[l * F..(l + 1) * F];
                    let (low, part, slope) = cell(point, grid, level);
                    corners(low, part, level, |row, u, s| {
                        let dot: f32 = (0..F).map(|f| grad[f] * rows[row][f]).sum();
                        to[0] += dot * s[0] * u[1] * u[2] * slope[0];
                        to[1] += dot * u[0] * s[1] * u[2] * slope[1];
                        to[2] += dot * u[0] * u[1] * s[2] * slope[2];
                    });
                }
            }
        });

    let mut levels: Vec<(usize, &Level, &mut [f32])> = Vec::with_capacity(grid.levels.len());
    let mut rest = to_table.as_mut_slice();
    for (l, level) in grid.levels.iter().enumerate() {
        let (rows, after) = rest.split_at_mut(level.rows * F);
        levels.push((l, level, rows));
        rest = after;
    }
    levels.into_par_iter().for_each(|(l, level, rows)| {
        let (rows, _) = rows.as_chunks_mut::<F>();
        for (point, grad) in points.chunks_exact(3).zip(grad.chunks_exact(width)) {
            let grad = &grad[l * F..(l + 1) * F];
            let (low, part, _) = cell(point, grid, level);
            corners(low, part, level, |row, u, _| {
                let share = u[0] * u[1] * u[2];
                for f in 0..F {
                    rows[row][f] += share * grad[f];
                }
            });
        }
    });
    (to_table, to_points)
}
