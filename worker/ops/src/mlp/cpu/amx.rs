//! Products of bf16 by the matrix instructions of AMX: a block of 32 by 32 sums stays in four tile
//! registers, and one instruction adds the products of two tiles of 16 by 32 numbers.
//!
//! The layout is that of [`Bf16`]: 16 rows of a panel, by rows, are a tile, and so are 16 words of
//! a packed weight or of the view by pairs, for 16 columns each. The first factor of a weight's
//! gradient is the exception: it is transposed here, panel by panel. Widths are padded to whole
//! tiles with zeros ([`super::kernels::Kernels::depth`]).
//!
//! Stable Rust has no intrinsics for these instructions, so they are written in assembly.
#![allow(clippy::needless_range_loop)] // As in `product`: blocks stay in registers.

use super::arithmetic::{Arithmetic, CellPosition, VECTORS};
use super::product::{End, Gradient, Product};
use super::vector::Vector;
use super::x86::Avx512;
use super::x86_bf16::Bf16;
use std::arch::asm;
use std::arch::x86_64::*;

/// Rows and columns of the block of sums, and numbers that one instruction sums over.
pub(super) const BLOCK: usize = 32;
/// Rows of a tile register; each has 64 bytes: 16 words.
pub(super) const TILE: usize = 16;
/// Largest number of rows per tile of rows, for which a transposed panel has room.
pub(super) const MOST_ROWS: usize = 512;

/// Columns per panel, which is also the width of a block.
const PANEL: usize = <Bf16 as Arithmetic>::PANEL;
const _: () = assert!(PANEL == BLOCK);
/// Bytes from a row of a tile to the next in packed weights, views by pairs and f32 panels.
const STRIDE: usize = 4 * PANEL;

/// A block of sums in memory.
#[repr(align(64))]
struct Block([f32; BLOCK * PANEL]);

/// Tile registers with a shape. They are released when this is dropped, since the operating system
/// must save them for as long as they are in use.
struct Shapes;

impl Shapes {
    /// Gives all eight registers 16 rows of 64 bytes.
    ///
    /// # Safety
    /// The machine must have AMX, and the process the permission to use it.
    #[inline(always)]
    unsafe fn set() -> Self {
        #[repr(C, align(64))]
        struct Config {
            palette: u8,
            start: u8,
            reserved: [u8; 14],
            bytes: [u16; 16],
            rows: [u8; 16],
        }
        let first_eight = |i: usize| i < 8;
        let config = Config {
            palette: 1,
            start: 0,
            reserved: [0; 14],
            bytes: std::array::from_fn(|i| if first_eight(i) { 64 } else { 0 }),
            rows: std::array::from_fn(|i| if first_eight(i) { TILE as u8 } else { 0 }),
        };
        // SAFETY: the instruction reads the 64 bytes of the configuration.
        unsafe { asm!("ldtilecfg [{}]", in(reg) &config, options(nostack, readonly)) }
        Self
    }
}

impl Drop for Shapes {
    #[inline(always)]
    fn drop(&mut self) {
        // SAFETY: the machine has AMX, as `set` asks.
        unsafe { asm!("tilerelease", options(nostack, nomem)) }
    }
}

/// Sets the block of sums to zero.
#[inline(always)]
unsafe fn zero() {
    // SAFETY: the registers have shapes, as the caller promises.
    unsafe {
        asm!(
            "tilezero tmm0",
            "tilezero tmm1",
            "tilezero tmm2",
            "tilezero tmm3",
            options(nostack, nomem)
        );
    }
}

/// Loads the block of sums from f32 rows that are [`STRIDE`] bytes apart.
#[inline(always)]
unsafe fn load(from: *const f32) {
    // SAFETY: the caller promises the block, and registers with shapes.
    unsafe {
        asm!(
            "tileloadd tmm0, [{first} + {stride}*1]",
            "tileloadd tmm1, [{first} + {stride}*1 + 64]",
            "tileloadd tmm2, [{second} + {stride}*1]",
            "tileloadd tmm3, [{second} + {stride}*1 + 64]",
            first = in(reg) from,
            second = in(reg) from.add(TILE * PANEL),
            stride = in(reg) STRIDE,
            options(nostack, readonly)
        );
    }
}

/// Stores the block of sums in f32 rows that are [`STRIDE`] bytes apart.
#[inline(always)]
unsafe fn store(to: *mut f32) {
    // SAFETY: the caller promises the block, and registers with shapes.
    unsafe {
        asm!(
            "tilestored [{first} + {stride}*1], tmm0",
            "tilestored [{first} + {stride}*1 + 64], tmm1",
            "tilestored [{second} + {stride}*1], tmm2",
            "tilestored [{second} + {stride}*1 + 64], tmm3",
            first = in(reg) to,
            second = in(reg) to.add(TILE * PANEL),
            stride = in(reg) STRIDE,
            options(nostack)
        );
    }
}

/// Adds to the block of sums the products of `steps` (at least 1) pairs of tiles: of the rows at
/// `a` and those at `below`, each 16 rows of 64 bytes, with the 16 rows of 32 words at `b`. The next tiles of `a` and
/// `below` are `next` bytes further on, those of `b` follow immediately.
#[inline(always)]
unsafe fn multiply(a: *const u32, below: *const u32, next: usize, b: *const u32, steps: usize) {
    // SAFETY: the caller promises all tiles, and registers with shapes.
    unsafe {
        asm!(
            "2:",
            "tileloadd tmm4, [{a} + {row}*1]",
            "tileloadd tmm6, [{b} + {stride}*1]",
            "tileloadd tmm7, [{b} + {stride}*1 + 64]",
            "tdpbf16ps tmm0, tmm4, tmm6",
            "tileloadd tmm5, [{below} + {row}*1]",
            "tdpbf16ps tmm1, tmm4, tmm7",
            "tdpbf16ps tmm2, tmm5, tmm6",
            "tdpbf16ps tmm3, tmm5, tmm7",
            "add {a}, {next}",
            "add {below}, {next}",
            "add {b}, {tile}",
            "dec {steps}",
            "jnz 2b",
            a = inout(reg) a => _,
            below = inout(reg) below => _,
            b = inout(reg) b => _,
            steps = inout(reg) steps => _,
            next = in(reg) next,
            row = in(reg) 64usize,
            stride = in(reg) STRIDE,
            tile = const TILE * STRIDE,
            options(nostack, readonly)
        );
    }
}

/// See [`super::product::product`].
///
/// # Safety
/// As there; the machine must have AMX with bf16, and the process the permission to use it. The
/// number of rows must be a multiple of [`BLOCK`].
#[target_feature(enable = "avx512f,avx512bw,avx512bf16")]
pub(super) unsafe fn product(task: &Product) {
    let words = |width: usize| width.next_multiple_of(PANEL) / 2;
    let depth: usize = task.factors.iter().map(|f| words(f.width)).sum();
    // SAFETY: panels and rows are within the shapes that the caller promises.
    unsafe {
        let _shapes = Shapes::set();
        for p in 0..task.columns.div_ceil(PANEL) {
            for row in (0..task.rows).step_by(BLOCK) {
                let plain = (p * task.rows + row) * PANEL;
                match task.end {
                    End::Added(to) => load(to.add(plain)),
                    _ => zero(),
                }
                let mut weights = task.weights.add(p * depth * PANEL);
                for factor in task.factors {
                    let panels = factor.width.div_ceil(PANEL);
                    let cells = factor.cells.add(row * TILE);
                    let next = 4 * task.rows * TILE;
                    multiply(cells, cells.add(TILE * TILE), next, weights, panels);
                    weights = weights.add(panels * TILE * PANEL);
                }
                match task.end {
                    End::Fresh(to) | End::Added(to) => store(to.add(plain)),
                    _ => finish(task, p, row),
                }
            }
        }
    }
}

/// Adds the bias to the block of sums at `row` of panel `p`, or masks it, and writes it.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512bf16")]
unsafe fn finish(task: &Product, p: usize, row: usize) {
    let mut block = Block([0.0; BLOCK * PANEL]);
    // SAFETY: the caller of `product` promises all shapes.
    unsafe {
        store(block.0.as_mut_ptr());
        let zeros = [Avx512::zero(); VECTORS];
        let bias: [Avx512; VECTORS] = match task.end {
            End::Hidden(bias, _) | End::Output(bias, _) => {
                std::array::from_fn(|j| Avx512::load(bias.add(p * PANEL + j * Avx512::LANES)))
            }
            _ => zeros,
        };
        for i in (0..BLOCK).step_by(2) {
            let position = |i: usize| CellPosition {
                rows: task.rows,
                panels: task.columns.div_ceil(PANEL),
                panel: p,
                row: row + i,
            };
            let mut pair = [zeros; 2];
            for r in 0..2 {
                for j in 0..VECTORS {
                    let at = (i + r) * PANEL + j * Avx512::LANES;
                    let sum = Avx512::load(block.0.as_ptr().add(at));
                    pair[r][j] = match task.end {
                        End::Hidden(..) => Avx512(_mm512_add_ps(sum.0, bias[j].0)).relu(),
                        End::Masked(by, _) => Bf16::where_over_zero(sum, by, position(i + r), j),
                        _ => Avx512(_mm512_add_ps(sum.0, bias[j].0)),
                    };
                }
            }
            match task.end {
                End::Hidden(_, cells) | End::Masked(_, cells) => {
                    Bf16::keep::<2, VECTORS>(&pair, cells, position(i));
                }
                End::Output(_, to) | End::Fresh(to) | End::Added(to) => {
                    for r in 0..2 {
                        for j in 0..VECTORS {
                            let at = (p * task.rows + row + i + r) * PANEL + j * Avx512::LANES;
                            pair[r][j].store(to.add(at));
                        }
                    }
                }
            }
        }
    }
}

/// See [`super::product::gradient`].
///
/// # Safety
/// As for [`product`]; there must be at most [`MOST_ROWS`] rows.
#[target_feature(enable = "avx512f,avx512bw,avx512bf16")]
pub(super) unsafe fn gradient(task: &Gradient) {
    /// A panel of a factor, transposed: `[half][step][column][row / 2]`.
    #[repr(align(64))]
    struct Transposed([u32; MOST_ROWS / 2 * PANEL]);

    let panels = task.result.width.div_ceil(PANEL);
    let steps = task.rows / BLOCK;
    let depth: usize = task
        .factors
        .iter()
        .map(|f| f.width.next_multiple_of(BLOCK))
        .sum();
    assert!(task.rows <= MOST_ROWS, "{} rows", task.rows);
    let mut transposed = Transposed([0; MOST_ROWS / 2 * PANEL]);
    // SAFETY: the caller promises all shapes; the transposed panel has room for the rows.
    unsafe {
        let by_pairs = |cells: *const u32, panels: usize, panel: usize| {
            cells.add(Bf16::by_pairs(CellPosition {
                rows: task.rows,
                panels,
                panel,
                row: 0,
            }))
        };
        let result = |p: usize| by_pairs(task.result.cells, panels, p);
        for p in 0..panels {
            add_rows(task.rows / 2, result(p), task.bias.add(p * PANEL));
        }
        let _shapes = Shapes::set();
        let mut row = 0;
        for factor in task.factors {
            let of_factor = factor.width.div_ceil(PANEL);
            for q in 0..of_factor {
                let cells = by_pairs(factor.cells, of_factor, q);
                let upper = transposed.0.as_mut_ptr();
                let lower = upper.add(steps * TILE * TILE);
                for step in 0..steps {
                    let from = cells.add(step * TILE * PANEL);
                    transpose(from, upper.add(step * TILE * TILE));
                    transpose(from.add(TILE), lower.add(step * TILE * TILE));
                }
                for p in 0..panels {
                    let to = task.weights.add((p * depth + row) * PANEL);
                    load(to);
                    multiply(upper, lower, 4 * TILE * TILE, result(p), steps);
                    store(to);
                }
                row += BLOCK;
            }
        }
    }
}

/// Adds the sum of `pairs` pairs of rows of a panel to `to` `[P]`.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512bf16")]
unsafe fn add_rows(pairs: usize, cells: *const u32, to: *mut f32) {
    // SAFETY: as the caller promises.
    unsafe {
        let ones = Bf16::ones();
        let mut sums: [Avx512; VECTORS] =
            std::array::from_fn(|j| Avx512::load(to.add(j * Avx512::LANES)));
        for pair in 0..pairs {
            for j in 0..VECTORS {
                let words = Bf16::load(cells.add(pair * PANEL + j * Avx512::LANES));
                sums[j] = Bf16::dot(sums[j], ones, words);
            }
        }
        for j in 0..VECTORS {
            sums[j].store(to.add(j * Avx512::LANES));
        }
    }
}

/// Transposes 16 rows of 16 words, which are [`PANEL`] words apart, into a tile.
#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
unsafe fn transpose(from: *const u32, to: *mut u32) {
    // SAFETY: the caller promises the rows and the tile.
    unsafe {
        let mut a = [_mm512_setzero_si512(); TILE];
        let mut b = a;
        for i in 0..8 {
            let row = |i: usize| _mm512_loadu_si512(from.add(i * PANEL).cast());
            a[2 * i] = _mm512_unpacklo_epi32(row(2 * i), row(2 * i + 1));
            a[2 * i + 1] = _mm512_unpackhi_epi32(row(2 * i), row(2 * i + 1));
        }
        for i in 0..4 {
            b[4 * i] = _mm512_unpacklo_epi64(a[4 * i], a[4 * i + 2]);
            b[4 * i + 1] = _mm512_unpackhi_epi64(a[4 * i], a[4 * i + 2]);
            b[4 * i + 2] = _mm512_unpacklo_epi64(a[4 * i + 1], a[4 * i + 3]);
            b[4 * i + 3] = _mm512_unpackhi_epi64(a[4 * i + 1], a[4 * i + 3]);
        }
        for i in 0..4 {
            let even = |x, y| _mm512_shuffle_i32x4::<0x88>(x, y);
            let odd = |x, y| _mm512_shuffle_i32x4::<0xdd>(x, y);
            let (first, second) = (even(b[i], b[i + 4]), odd(b[i], b[i + 4]));
            let (third, fourth) = (even(b[i + 8], b[i + 12]), odd(b[i + 8], b[i + 12]));
            let columns = [
                even(first, third),
                even(second, fourth),
                odd(first, third),
                odd(second, fourth),
            ];
            for (j, column) in columns.into_iter().enumerate() {
                _mm512_storeu_si512(to.add((i + 4 * j) * TILE).cast(), column);
            }
        }
    }
}
