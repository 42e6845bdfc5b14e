//! The hash grid on a GPU: a thread per point and level. Neighbouring threads have neighbouring points, so
//! that they often read the same rows.

use super::{HashGrid, HashOps};
use crate::cube::adding::{AddFloat, Bound, launch_adding};
use crate::cube::tensors::{each, empty, rows, upload, zeros};
use burn::backend::tensor::FloatTensor;
use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;

impl HashOps for CubeBackend {
    fn hash_encode(
        table: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grid: HashGrid,
    ) -> FloatTensor<Self> {
        forward(table, points, &grid)
    }

    fn hash_encode_backward(
        table: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        grid: HashGrid,
        needs_points_grad: bool,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        backward(table, points, grad, &grid, needs_points_grad)
    }
}

/// `[N, L F]` as in [`super::encode`].
fn forward(table: CubeTensor, points: CubeTensor, grid: &HashGrid) -> CubeTensor {
    let (table, points) = (rows(table), rows(points));
    let output = empty(&points, super::output_shape(points.meta.shape(), grid));
    let client = output.client.clone();
    let threads = points.meta.shape()[0] * grid.levels.len();
    if threads > 0 {
        let (count, dim) = each(&client, threads);
        encode_points::launch(
            &client,
            count,
            dim,
            table.into_buffer_arg(),
            points.into_buffer_arg(),
            upload(&client, &levels(grid)),
            output.clone().into_buffer_arg(),
            bounds(grid),
            grid.features,
        );
    }
    output
}

/// Gradients to the table (same shape) and, if `needs_points_grad`, the points `[N, 3]`, from `grad`
/// `[N, L F]`.
fn backward(
    table: CubeTensor,
    points: CubeTensor,
    grad: CubeTensor,
    grid: &HashGrid,
    needs_points_grad: bool,
) -> (CubeTensor, CubeTensor) {
    let (table, points, grad) = (rows(table), rows(points), rows(grad));
    let to_table = zeros(&table, table.meta.shape().clone());
    let to_points = empty(
        &points,
        super::points_gradient_shape(points.meta.shape(), needs_points_grad),
    );
    let client = points.client.clone();
    let n = points.meta.shape()[0];
    if n > 0 && !grid.levels.is_empty() {
        let (count, dim) = each(&client, n * grid.levels.len());
        launch_adding!(
            table_backward,
            &client,
            count,
            dim,
            points.clone().into_buffer_arg(),
            grad.clone().into_buffer_arg(),
            upload(&client, &levels(grid)),
            to_table.clone().into_buffer_arg(),
            bounds(grid),
            grid.features,
        );
        if needs_points_grad {
            let (count, dim) = each(&client, n);
            points_backward::launch(
                &client,
                count,
                dim,
                table.into_buffer_arg(),
                points.into_buffer_arg(),
                grad.into_buffer_arg(),
                upload(&client, &levels(grid)),
                to_points.clone().into_buffer_arg(),
                bounds(grid),
                grid.features,
            );
        }
    }
    (to_table, to_points)
}

/// Numbers per level in the kernels' buffer: cells per axis, first row, rows, and 1 if it is dense.
const LEVEL: usize = 4;

fn levels(grid: &HashGrid) -> Vec<u32> {
    let numbers = grid.levels.iter().flat_map(|level| {
        [
            level.cells,
            level.offset as u32,
            level.rows as u32,
            u32::from(level.dense),
        ]
    });
    numbers.collect()
}

fn bounds(grid: &HashGrid) -> BoundsLaunch {
    BoundsLaunch::new(grid.min[0], grid.min[1], grid.min[2], grid.side)
}

/// The cube that the grid covers, metres.
#[derive(CubeType, CubeLaunch)]
struct Bounds {
    min_x: f32,
    min_y: f32,
    min_z: f32,
    side: f32,
}

/// Position of a point along an axis of a level.
#[derive(CubeType, Clone, Copy)]
struct Axis {
    low: u32,
    part: f32,
    /// Cells per metre; 0 outside the cube, where the features are those of its border.
    slope: f32,
}

#[cube]
fn axis(x: f32, min: f32, side: f32, cells: u32) -> Axis {
    let raw = (x - min) / side;
    let unit = clamp(raw, 0.0, 1.0);
    let at = unit * f32::cast_from(cells);
    let mut low = u32::cast_from(at);
    if low >= cells {
        low = cells - 1;
    }
    let mut slope = 0.0f32;
    if raw == unit {
        slope = f32::cast_from(cells) / side;
    }
    Axis {
        low,
        part: at - f32::cast_from(low),
        slope,
    }
}

/// Row of a node in the whole table: `Level::row` in 32-bit arithmetic.
#[cube]
fn row(levels: &[u32], level: usize, x: u32, y: u32, z: u32) -> usize {
    let at = LEVEL * level;
    // h = x ⊕ π₂ y ⊕ π₃ z mod T (Instant NGP, eq. 4)
    let mut row = (x ^ (y * 2_654_435_761u32) ^ (z * 805_459_861u32)) & (levels[at + 2] - 1);
    if levels[at + 3] == 1 {
        let n = levels[at] + 1;
        row = (z * n + y) * n + x;
    }
    (levels[at + 1] + row) as usize
}

/// Linear weight of a node along an axis: `part` for the upper one, 1 − `part` for the lower one.
#[cube]
fn weight(part: f32, upper: u32) -> f32 {
    let mut weight = 1.0 - part;
    if upper == 1 {
        weight = part;
    }
    weight
}

/// Derivative of the weight with respect to `part`: ±1.
#[cube]
fn weight_derivative(upper: u32) -> f32 {
    2.0 * f32::cast_from(upper) - 1.0
}

/// Writes the features of each point at each level, `Σ wₖ table[rowₖ]` over the corners k of its cell.
#[cube(launch)]
fn encode_points(
    table: &[f32],
    points: &[f32],
    levels: &[u32],
    output: &mut [f32],
    bounds: &Bounds,
    #[comptime] features: usize,
) {
    let count = levels.len() / LEVEL;
    let n = points.len() / 3;
    if ABSOLUTE_POS >= n * count {
        terminate!();
    }
    let level = ABSOLUTE_POS / n;
    let i = ABSOLUTE_POS % n;
    let cells = levels[LEVEL * level];
    let x = axis(points[3 * i], bounds.min_x, bounds.side, cells);
    let y = axis(points[3 * i + 1], bounds.min_y, bounds.side, cells);
    let z = axis(points[3 * i + 2], bounds.min_z, bounds.side, cells);
    let mut sums = Array::<f32>::new(features);
    #[unroll]
    for f in 0..features {
        sums[f] = 0.0;
    }
    for corner in 0..8u32 {
        let bx = corner & 1;
        let by = (corner >> 1) & 1;
        let bz = corner >> 2;
        let part = weight(x.part, bx) * weight(y.part, by) * weight(z.part, bz);
        let at = row(levels, level, x.low + bx, y.low + by, z.low + bz) * features;
        #[unroll]
        for f in 0..features {
            sums[f] += part * table[at + f];
        }
    }
    let to = (i * count + level) * features;
    #[unroll]
    for f in 0..features {
        output[to + f] = sums[f];
    }
}

/// Adds the gradient to the table: `∂L/∂table[rowₖ] += wₖ ∂L/∂feature`. A thread per point and level.
#[cube(launch)]
fn table_backward<A: AddFloat>(
    points: &[f32],
    grad: &[f32],
    levels: &[u32],
    to_table: &mut [Atomic<Bound<A>>],
    bounds: &Bounds,
    #[comptime] features: usize,
) {
    let count = levels.len() / LEVEL;
    let n = points.len() / 3;
    if ABSOLUTE_POS >= n * count {
        terminate!();
    }
    let level = ABSOLUTE_POS / n;
    let i = ABSOLUTE_POS % n;
    let from = (i * count + level) * features;
    // Most rows are exactly zero where rays end early.
    let mut has_grad = false;
    #[unroll]
    for f in 0..features {
        has_grad = has_grad || grad[from + f] != 0.0;
    }
    if has_grad {
        let cells = levels[LEVEL * level];
        let x = axis(points[3 * i], bounds.min_x, bounds.side, cells);
        let y = axis(points[3 * i + 1], bounds.min_y, bounds.side, cells);
        let z = axis(points[3 * i + 2], bounds.min_z, bounds.side, cells);
        for corner in 0..8u32 {
            let bx = corner & 1;
            let by = (corner >> 1) & 1;
            let bz = corner >> 2;
            let part = weight(x.part, bx) * weight(y.part, by) * weight(z.part, bz);
            let at = row(levels, level, x.low + bx, y.low + by, z.low + bz) * features;
            #[unroll]
            for f in 0..features {
                A::add(&mut to_table[at + f], part * grad[from + f]);
            }
        }
    }
}

/// Writes the gradient to the points: `Σ ∂L/∂feature · table[rowₖ] ∇wₖ` over levels and corners. A thread per point.
#[cube(launch)]
fn points_backward(
    table: &[f32],
    points: &[f32],
    grad: &[f32],
    levels: &[u32],
    to_points: &mut [f32],
    bounds: &Bounds,
    #[comptime] features: usize,
) {
    let count = levels.len() / LEVEL;
    let i = ABSOLUTE_POS;
    if i >= points.len() / 3 {
        terminate!();
    }
    let mut to_x = 0.0f32;
    let mut to_y = 0.0f32;
    let mut to_z = 0.0f32;
    for level in 0..count {
        let from = (i * count + level) * features;
        let mut has_grad = false;
        #[unroll]
        for f in 0..features {
            has_grad = has_grad || grad[from + f] != 0.0;
        }
        if has_grad {
            let cells = levels[LEVEL * level];
            let x = axis(points[3 * i], bounds.min_x, bounds.side, cells);
            let y = axis(points[3 * i + 1], bounds.min_y, bounds.side, cells);
            let z = axis(points[3 * i + 2], bounds.min_z, bounds.side, cells);
            for corner in 0..8u32 {
                let bx = corner & 1;
                let by = (corner >> 1) & 1;
                let bz = corner >> 2;
                let at = row(levels, level, x.low + bx, y.low + by, z.low + bz) * features;
                let mut dot = 0.0f32;
                #[unroll]
                for f in 0..features {
                    dot += grad[from + f] * table[at + f];
                }
                let (u, v, w) = (weight(x.part, bx), weight(y.part, by), weight(z.part, bz));
                to_x += dot * weight_derivative(bx) * v * w * x.slope;
                to_y += dot * u * weight_derivative(by) * w * y.slope;
                to_z += dot * u * v * weight_derivative(bz) * z.slope;
            }
        }
    }
    to_points[3 * i] = to_x;
    to_points[3 * i + 1] = to_y;
    to_points[3 * i + 2] = to_z;
}
