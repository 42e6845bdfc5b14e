//! Vectors of AVX2 with FMA, and of AVX-512.

use super::vector::Vector;
use std::arch::x86_64::*;

/// Eight numbers; needs AVX2 and FMA.
#[derive(Clone, Copy)]
pub(super) struct Avx2(__m256);

// SAFETY: reads and writes `LANES` numbers; AVX2 and FMA are the caller's promise.
unsafe impl Vector for Avx2 {
    const LANES: usize = 8;

    #[inline(always)]
    unsafe fn zero() -> Self {
        // SAFETY: the machine has AVX2, as the trait asks.
        Self(unsafe { _mm256_setzero_ps() })
    }

    #[inline(always)]
    unsafe fn load(from: *const f32) -> Self {
        // SAFETY: the machine has AVX2 and the pointer is valid, as the trait asks.
        Self(unsafe { _mm256_loadu_ps(from) })
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut f32) {
        // SAFETY: the machine has AVX2 and the pointer is valid, as the trait asks.
        unsafe { _mm256_storeu_ps(to, self.0) }
    }

    #[inline(always)]
    unsafe fn splat(from: *const f32) -> Self {
        // SAFETY: the machine has AVX2 and the pointer is valid, as the trait asks.
        Self(unsafe { _mm256_set1_ps(*from) })
    }

    #[inline(always)]
    unsafe fn plus_product(self, a: Self, b: Self) -> Self {
        // SAFETY: the machine has FMA, as the trait asks.
        Self(unsafe { _mm256_fmadd_ps(a.0, b.0, self.0) })
    }

    #[inline(always)]
    unsafe fn relu(self) -> Self {
        // SAFETY: the machine has AVX2. Of a NaN and a number, `max` takes its second operand.
        Self(unsafe { _mm256_max_ps(_mm256_setzero_ps(), self.0) })
    }

    #[inline(always)]
    unsafe fn where_over_zero(self, by: Self) -> Self {
        // SAFETY: the machine has AVX2, as the trait asks.
        unsafe {
            let over = _mm256_cmp_ps::<_CMP_NLE_UQ>(by.0, _mm256_setzero_ps());
            Self(_mm256_and_ps(self.0, over))
        }
    }

    #[inline(always)]
    unsafe fn rounded(self) -> Self {
        // SAFETY: the machine has AVX2, as the trait asks.
        unsafe {
            let bits = _mm256_castps_si256(self.0);
            let odd = _mm256_and_si256(_mm256_srli_epi32::<16>(bits), _mm256_set1_epi32(1));
            let up = _mm256_add_epi32(_mm256_add_epi32(bits, _mm256_set1_epi32(0x7fff)), odd);
            let upper = _mm256_and_si256(up, _mm256_set1_epi32(0xffff_0000_u32 as i32));
            let nan = _mm256_cmp_ps::<_CMP_UNORD_Q>(self.0, self.0);
            Self(_mm256_blendv_ps(_mm256_castsi256_ps(upper), self.0, nan))
        }
    }
}

/// Sixteen numbers; needs AVX-512F.
#[derive(Clone, Copy)]
pub(super) struct Avx512(pub(super) __m512);

// SAFETY: reads and writes `LANES` numbers; AVX-512F is the caller's promise.
unsafe impl Vector for Avx512 {
    const LANES: usize = 16;

    #[inline(always)]
    unsafe fn zero() -> Self {
        // SAFETY: the machine has AVX-512F, as the trait asks.
        Self(unsafe { _mm512_setzero_ps() })
    }

    #[inline(always)]
    unsafe fn load(from: *const f32) -> Self {
        // SAFETY: the machine has AVX-512F and the pointer is valid, as the trait asks.
        Self(unsafe { _mm512_loadu_ps(from) })
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut f32) {
        // SAFETY: the machine has AVX-512F and the pointer is valid, as the trait asks.
        unsafe { _mm512_storeu_ps(to, self.0) }
    }

    #[inline(always)]
    unsafe fn splat(from: *const f32) -> Self {
        // SAFETY: the machine has AVX-512F and the pointer is valid, as the trait asks.
        Self(unsafe { _mm512_set1_ps(*from) })
    }

    #[inline(always)]
    unsafe fn plus_product(self, a: Self, b: Self) -> Self {
        // SAFETY: the machine has AVX-512F, as the trait asks.
        Self(unsafe { _mm512_fmadd_ps(a.0, b.0, self.0) })
    }

    #[inline(always)]
    unsafe fn relu(self) -> Self {
        // SAFETY: the machine has AVX-512F. Of a NaN and a number, `max` takes its second operand.
        Self(unsafe { _mm512_max_ps(_mm512_setzero_ps(), self.0) })
    }

    #[inline(always)]
    unsafe fn where_over_zero(self, by: Self) -> Self {
        // SAFETY: the machine has AVX-512F, as the trait asks.
        unsafe {
            let over = _mm512_cmp_ps_mask::<_CMP_NLE_UQ>(by.0, _mm512_setzero_ps());
            Self(_mm512_maskz_mov_ps(over, self.0))
        }
    }

    #[inline(always)]
    unsafe fn rounded(self) -> Self {
        // SAFETY: the machine has AVX-512F, as the trait asks.
        unsafe {
            let bits = _mm512_castps_si512(self.0);
            let odd = _mm512_and_si512(_mm512_srli_epi32::<16>(bits), _mm512_set1_epi32(1));
            let up = _mm512_add_epi32(_mm512_add_epi32(bits, _mm512_set1_epi32(0x7fff)), odd);
            let upper = _mm512_and_si512(up, _mm512_set1_epi32(0xffff_0000_u32 as i32));
            let nan = _mm512_cmp_ps_mask::<_CMP_UNORD_Q>(self.0, self.0);
            Self(_mm512_mask_mov_ps(_mm512_castsi512_ps(upper), nan, self.0))
        }
    }
}
