//! The arithmetic of products, and the layout of their factors in memory.
//!
//! A *cell buffer* holds a tile's activations, or gradients to them, `[rows, width]`, as
//! factors of products, in 32-bit words. Columns are grouped in panels of `P`. It has two views: by rows, `[panel][row][P / PAIR]`, where a word holds `PAIR` neighbouring columns
//! (a product sums over columns), and by pairs, `[panel][row / PAIR][P]`, where a word holds
//! `PAIR` neighbouring rows (a weight's gradient sums over rows). With f32 a word is a number,
//! `PAIR` is 1 and both views are the same; with bf16 a word is two numbers and the views take
//! half of the buffer each.
#![allow(clippy::needless_range_loop)] // As in `product`: blocks stay in registers.

use super::vector::Vector;
use std::marker::PhantomData;

/// Vectors per panel.
pub(super) const VECTORS: usize = 2;

/// Position of a block of cells: the buffer's shape, the panel and the first row.
#[derive(Clone, Copy)]
pub(super) struct CellPosition {
    /// Rows of the tile.
    pub rows: usize,
    /// Panels of the buffer.
    pub panels: usize,
    /// The block's panel.
    pub panel: usize,
    /// The block's first row.
    pub row: usize,
}

/// The arithmetic of products, and the layout of their factors.
///
/// # Safety
/// As for [`Vector`].
pub(super) unsafe trait Arithmetic {
    /// A vector of sums.
    type V: Vector;
    /// A vector of factors.
    type Factor: Copy;
    /// Numbers per word of a factor.
    const PAIR: usize;
    /// Columns per panel.
    const PANEL: usize = VECTORS * Self::V::LANES;

    /// `LANES` words from `from` on.
    unsafe fn load(from: *const u32) -> Self::Factor;
    /// The word at `from` in all lanes.
    unsafe fn splat(from: *const u32) -> Self::Factor;
    /// `sum` plus the products of the words' numbers.
    unsafe fn dot(sum: Self::V, a: Self::Factor, b: Self::Factor) -> Self::V;
    /// 1 in each number.
    unsafe fn ones() -> Self::Factor;
    /// Writes a block of `R` rows to `cells` at `position`, in both views; `R` is even.
    unsafe fn keep<const R: usize, const NV: usize>(
        block: &[[Self::V; NV]; R],
        cells: *mut u32,
        position: CellPosition,
    );
    /// `value` in the lanes where the cells of the vector with index `vector` at `position` are above 0 or NaN, and 0
    /// elsewhere: the derivative of the ReLU.
    unsafe fn where_over_zero(
        value: Self::V,
        cells: *const u32,
        position: CellPosition,
        vector: usize,
    ) -> Self::V;

    /// The first word of the block at `position` in the view by rows.
    #[inline(always)]
    fn by_rows(position: CellPosition) -> usize {
        (position.panel * position.rows + position.row) * Self::PANEL / Self::PAIR
    }

    /// The first word of the block at `position` in the view by pairs.
    #[inline(always)]
    fn by_pairs(position: CellPosition) -> usize {
        let half = if Self::PAIR == 1 {
            0
        } else {
            position.panels * position.rows * Self::PANEL / Self::PAIR
        };
        half + Self::by_rows(position)
    }
}

/// Products of f32. With `ROUNDED`, factors are rounded to bf16 when they are written. This gives the results
/// of bf16 on machines without instructions for it, at the speed of f32.
pub(super) struct Plain<V, const ROUNDED: bool>(PhantomData<V>);

// SAFETY: all memory is accessed through `V`, whose requirements are passed on.
unsafe impl<V: Vector, const ROUNDED: bool> Arithmetic for Plain<V, ROUNDED> {
    type V = V;
    type Factor = V;
    const PAIR: usize = 1;

    #[inline(always)]
    unsafe fn load(from: *const u32) -> V {
        // SAFETY: as the caller promises.
        unsafe { V::load(from.cast()) }
    }

    #[inline(always)]
    unsafe fn splat(from: *const u32) -> V {
        // SAFETY: as the caller promises.
        unsafe { V::splat(from.cast()) }
    }

    #[inline(always)]
    unsafe fn dot(sum: V, a: V, b: V) -> V {
        // SAFETY: as the caller promises.
        unsafe { sum.plus_product(a, b) }
    }

    #[inline(always)]
    unsafe fn ones() -> V {
        // SAFETY: the constant is a valid number.
        unsafe { V::splat(&1.0) }
    }

    #[inline(always)]
    unsafe fn keep<const R: usize, const NV: usize>(
        block: &[[V; NV]; R],
        cells: *mut u32,
        position: CellPosition,
    ) {
        // SAFETY: the position that the caller gives lies in the buffer.
        unsafe {
            let to = cells.add(Self::by_rows(position)).cast::<f32>();
            for i in 0..R {
                for j in 0..NV {
                    let value = block[i][j];
                    let value = if ROUNDED { value.rounded() } else { value };
                    value.store(to.add(i * Self::PANEL + j * V::LANES));
                }
            }
        }
    }

    #[inline(always)]
    unsafe fn where_over_zero(
        value: V,
        cells: *const u32,
        position: CellPosition,
        vector: usize,
    ) -> V {
        // SAFETY: the position that the caller gives lies in the buffer.
        unsafe {
            let by = cells.add(Self::by_rows(position) + vector * V::LANES);
            value.where_over_zero(V::load(by.cast()))
        }
    }
}
