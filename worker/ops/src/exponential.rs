//! The exponential function in a form that the compiler vectorizes; that of the C library is a call per number.

use crate::form::multiply_add;

/// eˣ for x ≤ 0, to two units in the last place; 0 below −87, where results would be subnormal,
/// and NaN for NaN. The polynomial is that of `expf` in Cephes.
#[inline(always)]
pub fn exp_of_negative<const FMA: bool>(x: f32) -> f32 {
    /// Adding it rounds numbers of less than 2²² to whole ones, in the lowest bits.
    const ROUND: f32 = 12_582_912.0;
    const LN_2_HIGH: f32 = 0.693_359_4;
    const LN_2_LOW: f32 = -2.121_944_4e-4;
    // eˣ = 2ⁿ eʳ with r = x − n ln 2; ln 2 in two parts keeps r exact
    let shifted = multiply_add::<FMA>(x, std::f32::consts::LOG2_E, ROUND);
    let whole = shifted - ROUND;
    let r = multiply_add::<FMA>(whole, -LN_2_HIGH, x);
    let r = multiply_add::<FMA>(whole, -LN_2_LOW, r);
    let mut p = multiply_add::<FMA>(1.987_569_1e-4, r, 1.398_199_9e-3);
    p = multiply_add::<FMA>(p, r, 8.333_452e-3);
    p = multiply_add::<FMA>(p, r, 4.166_579_6e-2);
    p = multiply_add::<FMA>(p, r, 1.666_666_5e-1);
    p = multiply_add::<FMA>(p, r, 0.5);
    p = multiply_add::<FMA>(p, r * r, r) + 1.0;
    let exponent = (shifted.to_bits() as i32).wrapping_sub(ROUND.to_bits() as i32);
    let power = f32::from_bits(exponent.wrapping_add(127).wrapping_shl(23) as u32);
    if x < -87.0 { 0.0 } else { p * power }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponential_is_exact_to_two_units_in_the_last_place() {
        let check = |x: f32| {
            for value in [exp_of_negative::<false>(x), exp_of_negative::<true>(x)] {
                let exact = f64::from(x).exp();
                let error = (f64::from(value) - exact).abs() / exact;
                assert!(error < 2.4e-7, "e^{x} = {value}: {error:e}");
            }
        };
        // Miri runs a thousandth of the points: each takes it a thousand times as long.
        let points = if cfg!(miri) { 870 } else { 870_000 };
        (0..points)
            .map(|i| -87.0 * i as f32 / points as f32)
            .for_each(check);
        for x in [-87.1, -1e4, f32::NEG_INFINITY] {
            assert_eq!(exp_of_negative::<true>(x), 0.0, "{x}");
        }
        assert_eq!(exp_of_negative::<true>(0.0), 1.0);
        assert!(exp_of_negative::<true>(f32::NAN).is_nan());
    }
}
