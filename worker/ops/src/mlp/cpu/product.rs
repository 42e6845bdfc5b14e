//! The matrix products over one tile, which take nearly all of the time, written once for every
//! [`Arithmetic`].
//!
//! Sums must stay in registers: blocks are accessed by constant indices, for which the compiler
//! unrolls the loops. With iterators it kept the sums in memory.
#![allow(clippy::needless_range_loop)]

use super::arithmetic::{Arithmetic, CellPosition, VECTORS};
use super::vector::Vector;

/// A factor of a product: `width` columns in a cell buffer.
#[derive(Clone, Copy)]
pub(super) struct Factor {
    /// The buffer.
    pub cells: *const u32,
    /// Columns.
    pub width: usize,
}

/// `[factors] · weights`, `[rows, columns]`.
pub(super) struct Product<'a> {
    /// Rows of the tile, a multiple of the kernels' `rows`.
    pub rows: usize,
    /// Factors, side by side.
    pub factors: &'a [Factor],
    /// `[panel][word][P]`: a word holds `PAIR` of the factors' columns; each factor begins with a
    /// new word.
    pub weights: *const u32,
    /// Columns of the result.
    pub columns: usize,
    /// The use of the sums.
    pub end: End,
}

/// The use of the sums of a product.
#[derive(Clone, Copy)]
pub(super) enum End {
    /// A bias `[columns]`, padded to panels, is added; the ReLU of the sums is written to the cell
    /// buffer.
    Hidden(*const f32, *mut u32),
    /// A bias is added; the sums are written as f32 `[panel][row][P]`.
    Output(*const f32, *mut f32),
    /// The sums where the first cell buffer is over 0, and 0 elsewhere, are written to the second
    /// one.
    Masked(*const u32, *mut u32),
    /// The sums are written as f32 `[panel][row][P]`.
    Fresh(*mut f32),
    /// The sums are added to f32 `[panel][row][P]`.
    Added(*mut f32),
}

/// Gradients to a layer's weights and bias: sums over the tile's rows, added to those before.
pub(super) struct Gradient<'a> {
    /// Rows of the tile.
    pub rows: usize,
    /// The layer's factors.
    pub factors: &'a [Factor],
    /// Gradient to the layer's result.
    pub result: Factor,
    /// `[panel][k][P]`; each factor has its width rounded up to the kernels' `block`.
    pub weights: *mut f32,
    /// `[columns]`, padded to panels.
    pub bias: *mut f32,
}

/// f32 rows to be written to a cell buffer.
pub(super) struct Fill {
    /// Rows of the tile.
    pub rows: usize,
    /// Columns.
    pub width: usize,
    /// `[rows, stride]`, the stride being the width rounded up to panels.
    pub from: *const f32,
    /// The cell buffer.
    pub cells: *mut u32,
}

/// See [`Product`]; `MR` rows at a time.
///
/// # Safety
/// All pointers must be valid for the documented shapes, and the machine must have the
/// instructions of `A`. What is written must not overlap what is read, but for [`End::Added`].
#[inline(always)]
pub(super) unsafe fn product<A: Arithmetic, const MR: usize>(task: &Product) {
    let panel = A::PANEL;
    let words: usize = task.factors.iter().map(|f| f.width.div_ceil(A::PAIR)).sum();
    for p in 0..task.columns.div_ceil(panel) {
        let narrow = task.columns - p * panel <= A::V::LANES;
        for row in (0..task.rows).step_by(MR) {
            // SAFETY: panel and rows are within the shapes that the caller promises.
            unsafe {
                let weights = task.weights.add(p * words * panel);
                if narrow {
                    product_block::<A, MR, 1>(task, weights, p, row);
                } else {
                    product_block::<A, MR, VECTORS>(task, weights, p, row);
                }
            }
        }
    }
}

#[inline(always)]
unsafe fn product_block<A: Arithmetic, const MR: usize, const NV: usize>(
    task: &Product,
    mut weights: *const u32,
    p: usize,
    row: usize,
) {
    let (panel, lanes) = (A::PANEL, A::V::LANES);
    let position = CellPosition {
        rows: task.rows,
        panels: task.columns.div_ceil(panel),
        panel: p,
        row,
    };
    let plain = (p * task.rows + row) * panel;
    // SAFETY: the caller of `product` promises all shapes.
    unsafe {
        let mut sums = [[A::V::zero(); NV]; MR];
        match task.end {
            End::Hidden(bias, _) | End::Output(bias, _) => {
                for j in 0..NV {
                    let bias = A::V::load(bias.add(p * panel + j * lanes));
                    for i in 0..MR {
                        sums[i][j] = bias;
                    }
                }
            }
            End::Added(to) => {
                for i in 0..MR {
                    for j in 0..NV {
                        sums[i][j] = A::V::load(to.add(plain + i * panel + j * lanes));
                    }
                }
            }
            End::Masked(..) | End::Fresh(_) => {}
        }
        for factor in task.factors {
            let panels = factor.width.div_ceil(panel);
            for q in 0..panels {
                let from = CellPosition {
                    rows: task.rows,
                    panels,
                    panel: q,
                    row,
                };
                let cells = factor.cells.add(A::by_rows(from));
                let words = panel.min(factor.width - q * panel).div_ceil(A::PAIR);
                for k in 0..words {
                    let w: [A::Factor; NV] =
                        std::array::from_fn(|j| A::load(weights.add(j * lanes)));
                    for i in 0..MR {
                        let x = A::splat(cells.add(i * (panel / A::PAIR) + k));
                        for j in 0..NV {
                            sums[i][j] = A::dot(sums[i][j], x, w[j]);
                        }
                    }
                    weights = weights.add(panel);
                }
            }
        }
        match task.end {
            End::Hidden(_, cells) => {
                for i in 0..MR {
                    for j in 0..NV {
                        sums[i][j] = sums[i][j].relu();
                    }
                }
                A::keep(&sums, cells, position);
            }
            End::Masked(by, cells) => {
                for i in 0..MR {
                    let position = CellPosition {
                        row: row + i,
                        ..position
                    };
                    for j in 0..NV {
                        sums[i][j] = A::where_over_zero(sums[i][j], by, position, j);
                    }
                }
                A::keep(&sums, cells, position);
            }
            End::Output(_, to) | End::Fresh(to) | End::Added(to) => {
                for i in 0..MR {
                    for j in 0..NV {
                        sums[i][j].store(to.add(plain + i * panel + j * lanes));
                    }
                }
            }
        }
    }
}

/// See [`Gradient`]; `KR` rows of the weight at a time.
///
/// # Safety
/// As for [`product`].
#[inline(always)]
pub(super) unsafe fn gradient<A: Arithmetic, const KR: usize>(task: &Gradient) {
    let panel = A::PANEL;
    let panels = task.result.width.div_ceil(panel);
    for p in 0..panels {
        // SAFETY: the panel is within the shapes that the caller promises.
        unsafe {
            if task.result.width - p * panel <= A::V::LANES {
                gradient_panel::<A, KR, 1>(task, panels, p);
            } else {
                gradient_panel::<A, KR, VECTORS>(task, panels, p);
            }
        }
    }
}

#[inline(always)]
unsafe fn gradient_panel<A: Arithmetic, const KR: usize, const NV: usize>(
    task: &Gradient,
    panels: usize,
    p: usize,
) {
    let (panel, lanes) = (A::PANEL, A::V::LANES);
    let at = |panels, panel| CellPosition {
        rows: task.rows,
        panels,
        panel,
        row: 0,
    };
    let steps = task.rows / A::PAIR;
    let depth: usize = task
        .factors
        .iter()
        .map(|f| f.width.next_multiple_of(KR))
        .sum();
    // SAFETY: the caller of `gradient` promises all shapes.
    unsafe {
        let result = task.result.cells.add(A::by_pairs(at(panels, p)));
        let to = task.bias.add(p * panel);
        let mut sums: [A::V; NV] = std::array::from_fn(|j| A::V::load(to.add(j * lanes)));
        let ones = A::ones();
        for step in 0..steps {
            for j in 0..NV {
                let z = A::load(result.add(step * panel + j * lanes));
                sums[j] = A::dot(sums[j], ones, z);
            }
        }
        for j in 0..NV {
            sums[j].store(to.add(j * lanes));
        }
        let mut to = task.weights.add(p * depth * panel);
        for factor in task.factors {
            let panels = factor.width.div_ceil(panel);
            for q in 0..panels {
                let cells = factor.cells.add(A::by_pairs(at(panels, q)));
                for k in (0..panel.min(factor.width - q * panel)).step_by(KR) {
                    gradient_block::<A, KR, NV>(steps, cells.add(k), result, to);
                    to = to.add(KR * panel);
                }
            }
        }
    }
}

#[inline(always)]
unsafe fn gradient_block<A: Arithmetic, const KR: usize, const NV: usize>(
    steps: usize,
    mut cells: *const u32,
    mut result: *const u32,
    to: *mut f32,
) {
    let (panel, lanes) = (A::PANEL, A::V::LANES);
    // SAFETY: the caller of `gradient` promises all shapes.
    unsafe {
        let mut sums: [[A::V; NV]; KR] = std::array::from_fn(|i| {
            std::array::from_fn(|j| A::V::load(to.add(i * panel + j * lanes)))
        });
        for _ in 0..steps {
            let z: [A::Factor; NV] = std::array::from_fn(|j| A::load(result.add(j * lanes)));
            for i in 0..KR {
                let x = A::splat(cells.add(i));
                for j in 0..NV {
                    sums[i][j] = A::dot(sums[i][j], x, z[j]);
                }
            }
            cells = cells.add(panel);
            result = result.add(panel);
        }
        for i in 0..KR {
            for j in 0..NV {
                sums[i][j].store(to.add(i * panel + j * lanes));
            }
        }
    }
}

/// See [`Fill`].
///
/// # Safety
/// As for [`product`].
#[inline(always)]
pub(super) unsafe fn fill<A: Arithmetic>(task: &Fill) {
    let (panel, lanes) = (A::PANEL, A::V::LANES);
    let panels = task.width.div_ceil(panel);
    for p in 0..panels {
        for row in (0..task.rows).step_by(2) {
            let position = CellPosition {
                rows: task.rows,
                panels,
                panel: p,
                row,
            };
            // SAFETY: the caller promises all shapes; rows are even in number.
            unsafe {
                let block: [[A::V; VECTORS]; 2] = std::array::from_fn(|i| {
                    std::array::from_fn(|j| {
                        let column = p * panel + j * lanes;
                        A::V::load(task.from.add((row + i) * panels * panel + column))
                    })
                });
                A::keep(&block, task.cells, position);
            }
        }
    }
}
