//! Vectors of f32 as the products use them, and the implementation for any machine.
//!
//! The products are written once, generic over this trait. Each of their instances is inlined into
//! a function that enables the form's vector instructions (see [`mod@super::kernels`]).

/// A vector of f32.
///
/// # Safety
/// Pointers must be valid for `LANES` numbers, and the machine must have the instructions of
/// the implementing type.
pub(super) unsafe trait Vector: Copy {
    /// Numbers per vector.
    const LANES: usize;
    /// All 0.
    unsafe fn zero() -> Self;
    /// `LANES` numbers from `from` on, which needs no alignment.
    unsafe fn load(from: *const f32) -> Self;
    /// Writes the numbers to `to` on, which needs no alignment.
    unsafe fn store(self, to: *mut f32);
    /// The number at `from` in all lanes.
    unsafe fn splat(from: *const f32) -> Self;
    /// `self + a b`.
    unsafe fn plus_product(self, a: Self, b: Self) -> Self;
    /// `max(self, 0)`; a NaN stays a NaN.
    unsafe fn relu(self) -> Self;
    /// `self` where `by` is over 0 or NaN, else 0.
    unsafe fn where_over_zero(self, by: Self) -> Self;
    /// Each number rounded to the nearest bf16, ties to even.
    unsafe fn rounded(self) -> Self;
}

/// `value` rounded to the nearest bf16, ties to even, as the upper half of an f32.
#[inline(always)]
pub(super) fn bf16_bits(value: f32) -> u16 {
    let bits = value.to_bits();
    let even = 0x7fff + (bits >> 16 & 1);
    let rounded = (bits.wrapping_add(even) >> 16) as u16;
    // A NaN must not round to infinity.
    let nan = (bits >> 16) as u16 | 0x40;
    if value.is_nan() { nan } else { rounded }
}

/// `value` rounded to the nearest bf16, ties to even.
#[inline(always)]
pub(super) fn bf16_rounded(value: f32) -> f32 {
    f32::from_bits(u32::from(bf16_bits(value)) << 16)
}

/// Four numbers, which the compiler keeps in a vector register if the target has one.
#[derive(Clone, Copy)]
pub(super) struct Portable([f32; 4]);

impl Portable {
    #[inline(always)]
    fn each(self, by: impl Fn(f32) -> f32) -> Self {
        Self(self.0.map(by))
    }
}

// SAFETY: plain reads and writes of `LANES` numbers; no instructions beyond the target's.
unsafe impl Vector for Portable {
    const LANES: usize = 4;

    #[inline(always)]
    unsafe fn zero() -> Self {
        Self([0.0; 4])
    }

    #[inline(always)]
    unsafe fn load(from: *const f32) -> Self {
        // SAFETY: the caller's pointer is valid for four numbers.
        Self(unsafe { [*from, *from.add(1), *from.add(2), *from.add(3)] })
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut f32) {
        // SAFETY: the caller's pointer is valid for four numbers.
        unsafe {
            for (i, value) in self.0.into_iter().enumerate() {
                *to.add(i) = value;
            }
        }
    }

    #[inline(always)]
    unsafe fn splat(from: *const f32) -> Self {
        // SAFETY: the caller's pointer is valid.
        Self([unsafe { *from }; 4])
    }

    #[inline(always)]
    unsafe fn plus_product(self, a: Self, b: Self) -> Self {
        // Written out: the compiler does not vectorise loops over four numbers.
        let ([s0, s1, s2, s3], [a0, a1, a2, a3], [b0, b1, b2, b3]) = (self.0, a.0, b.0);
        Self([s0 + a0 * b0, s1 + a1 * b1, s2 + a2 * b2, s3 + a3 * b3])
    }

    #[inline(always)]
    unsafe fn relu(self) -> Self {
        self.each(|x| if x < 0.0 { 0.0 } else { x })
    }

    #[inline(always)]
    unsafe fn where_over_zero(self, by: Self) -> Self {
        Self(std::array::from_fn(|i| {
            if by.0[i] <= 0.0 { 0.0 } else { self.0[i] }
        }))
    }

    #[inline(always)]
    unsafe fn rounded(self) -> Self {
        self.each(bf16_rounded)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_to_bf16_is_to_nearest_even_and_keeps_infinity_and_nan() {
        // One bf16 step at 1 is 2⁻⁷: halfway values go to the even neighbour.
        let step = 2f32.powi(-7);
        for (value, rounded) in [
            (1.0, 1.0),
            (1.0 + 0.5 * step, 1.0),
            (1.0 + 1.5 * step, 1.0 + 2.0 * step),
            (1.0 + 0.51 * step, 1.0 + step),
            (-1.0 - 1.5 * step, -1.0 - 2.0 * step),
            (0.0, 0.0),
            (f32::INFINITY, f32::INFINITY),
            (f32::MAX, f32::INFINITY),
        ] {
            assert_eq!(bf16_rounded(value), rounded, "{value}");
        }
        assert!(bf16_rounded(f32::NAN).is_nan());
        assert!(bf16_rounded(f32::from_bits(0x7f80_0001)).is_nan());
    }
}
