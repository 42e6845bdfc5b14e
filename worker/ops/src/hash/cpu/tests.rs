//! Blocks and levels without threads, so that Miri can check the look-ups.

use super::backward::{Gather, Scatter};
use super::cells::{LANES, Lanes};
use super::forward::Block;
use super::*;
use crate::hash::Level;

const FEATURES: usize = 2;
/// More than one vector, and not a multiple of it.
const POINTS: usize = LANES + 3;

/// A grid with dense and hashed levels.
fn grid() -> HashGrid {
    let grid = HashGrid::new(3, 2, 1.9, 5, FEATURES, [-1.0, 0.0, 2.0], 2.0);
    assert!(grid.levels[0].dense && !grid.levels[2].dense);
    grid
}

/// Numbers in ±1.
fn numbers(count: usize, step: f32) -> Vec<f32> {
    (0..count).map(|i| (i as f32 * step).sin()).collect()
}

/// Points in the cube, a few of them on its border or outside.
fn points(grid: &HashGrid) -> Vec<f32> {
    let unit = numbers(3 * POINTS, 0.7).into_iter().map(|x| 0.5 + 0.6 * x);
    let in_cube = |(i, x): (usize, f32)| grid.min[i % 3] + x * grid.side;
    unit.enumerate().map(in_cube).collect()
}

/// Rows of the table and trilinear weights of the corners of the cell of `point`.
fn corners(point: &[f32], grid: &HashGrid, level: &Level) -> [(usize, f32); 8] {
    let at: [f32; 3] = std::array::from_fn(|a| {
        ((point[a] - grid.min[a]) / grid.side).clamp(0.0, 1.0) * level.cells as f32
    });
    let low = at.map(|x| (x as u32).min(level.cells - 1));
    std::array::from_fn(|corner| {
        let bit: [u32; 3] = std::array::from_fn(|a| corner as u32 >> a & 1);
        let part = |a: usize| at[a] - low[a] as f32;
        let weight = |a: usize| if bit[a] == 1 { part(a) } else { 1.0 - part(a) };
        let row = level.offset + level.row(std::array::from_fn(|a| low[a] + bit[a]));
        (row, weight(0) * weight(1) * weight(2))
    })
}

fn assert_close(ours: &[f32], expected: &[f32], part: &str) {
    assert_eq!(ours.len(), expected.len(), "{part}");
    for (i, (a, b)) in ours.iter().zip(expected).enumerate() {
        assert!((a - b).abs() < 1e-5, "{part} {i}: {a} instead of {b}");
    }
}

#[test]
fn a_block_looks_up_what_its_points_lie_between() {
    let grid = grid();
    let (table, points) = (numbers(FEATURES * grid.rows(), 0.3), points(&grid));
    let mut expected = Vec::new();
    for point in points.chunks_exact(3) {
        for level in &grid.levels {
            for f in 0..FEATURES {
                let corners = corners(point, &grid, level).into_iter();
                let sum = corners.map(|(row, weight)| weight * table[FEATURES * row + f]);
                expected.push(sum.sum::<f32>());
            }
        }
    }
    for form in Form::of_loops() {
        let mut output = vec![0f32; POINTS * grid.width()];
        form.run(Block::<FEATURES> {
            table: &table,
            points: &points,
            output: &mut output,
            grid: &grid,
        });
        assert_close(&output, &expected, form.name());
    }
}

#[test]
fn gradients_of_a_block_go_to_the_rows_that_were_looked_up() {
    let grid = grid();
    let width = grid.width();
    let (table, points) = (numbers(FEATURES * grid.rows(), 0.3), points(&grid));
    let mut grad = numbers(POINTS * width, 1.1);
    // A point whose gradient is 0.
    grad[5 * width..6 * width].fill(0.0);
    let mut expected = vec![0f32; table.len()];
    for (point, grad) in points.chunks_exact(3).zip(grad.chunks_exact(width)) {
        for (level, grad) in grid.levels.iter().zip(grad.chunks_exact(FEATURES)) {
            for (row, weight) in corners(point, &grid, level) {
                for (f, g) in grad.iter().enumerate() {
                    expected[FEATURES * row + f] += weight * g;
                }
            }
        }
    }
    for form in Form::of_loops() {
        let block = form.run(Gather {
            points: &points,
            grad: &grad,
            grid: &grid,
        });
        let blocks = [block];
        let mut to_table = vec![0f32; table.len()];
        for (l, level) in grid.levels.iter().enumerate() {
            let range = FEATURES * level.offset..FEATURES * (level.offset + level.rows);
            let mut to_unit: Vec<[Lanes; 3]> = Vec::new();
            form.run(Scatter::<FEATURES> {
                rows: table[range.clone()].as_chunks().0,
                to_rows: to_table[range].as_chunks_mut().0,
                to_unit: Some(&mut to_unit),
                blocks: &blocks,
                width,
                level,
                l,
            });
            assert_eq!(to_unit.len(), (POINTS - 1).div_ceil(LANES));
        }
        assert_close(&to_table, &expected, form.name());
    }
}
