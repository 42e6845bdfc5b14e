//! Products of bf16 by the instructions of AVX512-BF16: a word holds two numbers, whose two
//! products are added to an f32 at once.
#![allow(clippy::needless_range_loop)] // As in `product`: blocks stay in registers.

use super::arithmetic::{Arithmetic, CellPosition};
use super::vector::Vector;
use super::x86::Avx512;
use std::arch::x86_64::*;

/// bf16 products; needs AVX-512F, AVX-512BW and AVX512-BF16.
pub(super) struct Bf16;

/// Order that interleaves the numbers of two vectors: the view by pairs of two rows.
static INTERLEAVED: [u16; 32] = {
    let mut order = [0; 32];
    let mut i = 0;
    while i < 16 {
        order[2 * i] = i as u16;
        order[2 * i + 1] = 16 + i as u16;
        i += 1;
    }
    order
};

// SAFETY: reads and writes the words that the trait documents; the instructions are the caller's
// promise.
unsafe impl Arithmetic for Bf16 {
    type V = Avx512;
    type Factor = __m512i;
    const PAIR: usize = 2;

    #[inline(always)]
    unsafe fn load(from: *const u32) -> __m512i {
        // SAFETY: as the caller promises.
        unsafe { _mm512_loadu_si512(from.cast()) }
    }

    #[inline(always)]
    unsafe fn splat(from: *const u32) -> __m512i {
        // SAFETY: as the caller promises.
        unsafe { _mm512_set1_epi32(from.cast::<i32>().read()) }
    }

    #[inline(always)]
    unsafe fn dot(sum: Avx512, a: __m512i, b: __m512i) -> Avx512 {
        // SAFETY: the machine has AVX512-BF16; the types differ in name only.
        unsafe {
            let a = std::mem::transmute::<__m512i, __m512bh>(a);
            let b = std::mem::transmute::<__m512i, __m512bh>(b);
            Avx512(_mm512_dpbf16_ps(sum.0, a, b))
        }
    }

    #[inline(always)]
    unsafe fn ones() -> __m512i {
        // SAFETY: the machine has AVX-512F.
        unsafe { _mm512_set1_epi32(0x3f80_3f80) }
    }

    #[inline(always)]
    unsafe fn keep<const R: usize, const NV: usize>(
        block: &[[Avx512; NV]; R],
        cells: *mut u32,
        position: CellPosition,
    ) {
        // SAFETY: the position that the caller gives lies in the buffer; `R` is even.
        unsafe {
            let rows = cells.add(Self::by_rows(position));
            let pairs = cells.add(Self::by_pairs(position));
            let order = _mm512_loadu_si512(INTERLEAVED.as_ptr().cast());
            let stride = Self::PANEL / 2;
            for i in (0..R).step_by(2) {
                for j in 0..NV {
                    let both = _mm512_cvtne2ps_pbh(block[i + 1][j].0, block[i][j].0);
                    let both = std::mem::transmute::<__m512bh, __m512i>(both);
                    let first = rows.add(i * stride + j * 8);
                    _mm256_storeu_si256(first.cast(), _mm512_castsi512_si256(both));
                    let second = _mm512_extracti64x4_epi64::<1>(both);
                    _mm256_storeu_si256(first.add(stride).cast(), second);
                    let pair = _mm512_permutexvar_epi16(order, both);
                    _mm512_storeu_si512(pairs.add(i * stride + j * 16).cast(), pair);
                }
            }
        }
    }

    #[inline(always)]
    unsafe fn where_over_zero(
        value: Avx512,
        cells: *const u32,
        position: CellPosition,
        vector: usize,
    ) -> Avx512 {
        // SAFETY: the position that the caller gives lies in the buffer.
        unsafe {
            let by = cells.add(Self::by_rows(position) + vector * 8);
            // The upper half of an f32 is its bf16.
            let wide = _mm512_cvtepu16_epi32(_mm256_loadu_si256(by.cast()));
            let by = _mm512_castsi512_ps(_mm512_slli_epi32::<16>(wide));
            value.where_over_zero(Avx512(by))
        }
    }
}
