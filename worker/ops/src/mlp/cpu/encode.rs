//! The frequency encoding of a tile's points.
//!
//! Inside the operation the order of the columns is all sines (band by band, x y z), all cosines,
//! and the point itself, so that neighbouring lanes do the same; weights are packed in that order.
//! The compiler vectorizes the loops with the instructions of each form.

use crate::encode::Bands;
use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};

/// Lanes computed at once.
const LANES: usize = 16;
/// Larger angles, radians, are left to the standard library; up to this one, the error of the reduced angle is
/// 2e-8, and no point that a network was trained on is that far away.
const LARGEST: f32 = 1e8;
/// Adding 1.5 · 2⁵² to an f64 leaves the nearest integer in its lowest bits.
const TO_INTEGER: f64 = 6_755_399_441_055_744.0;

/// Constants of the encoding, one entry per angle, padded with zeros to a multiple of the lanes.
#[derive(Clone, Debug)]
pub(super) struct Angles {
    /// Angles per point: 3 per band.
    count: usize,
    /// Radians per metre of each angle.
    scales: Vec<f32>,
    /// Weights of the sines and cosines.
    window: Vec<f32>,
    /// Whether the point itself is a part of its encoding.
    raw: bool,
}

impl Angles {
    /// The encoding of the three coordinates of a point in `bands`, and with `raw` also the point itself.
    pub(super) fn new(bands: &Bands, raw: bool) -> Self {
        let count = 3 * bands.count;
        let mut scales = vec![0.0; count.next_multiple_of(LANES)];
        let mut weights = scales.clone();
        for (band, (radians, weight)) in bands.each().enumerate() {
            scales[3 * band..3 * band + 3].fill(radians);
            weights[3 * band..3 * band + 3].fill(weight);
        }
        Self {
            count,
            scales,
            window: weights,
            raw,
        }
    }

    /// Index of each column in the plain order: the point, then sines and cosines band by
    /// band.
    pub(super) fn order(&self) -> Vec<usize> {
        let first = if self.raw { 3 } else { 0 };
        let column = |cosine: usize| move |i: usize| first + 6 * (i / 3) + 3 * cosine + i % 3;
        (0..self.count)
            .map(column(0))
            .chain((0..self.count).map(column(1)))
            .chain(0..first)
            .collect()
    }
}

/// Sines and cosines of angles in radians, with errors of at most 1.2e-7.
#[inline(always)]
fn sines_cosines(angles: &[f32; LANES]) -> ([f32; LANES], [f32; LANES]) {
    let (mut sines, mut cosines) = ([0f32; LANES], [0f32; LANES]);
    for i in 0..LANES {
        // The multiple of π/2 is subtracted in f64, whose 53 bits are enough; in f32 π/2 would have
        // to be split into three parts.
        let x = f64::from(angles[i]);
        let shifted = x * FRAC_2_PI + TO_INTEGER;
        let quarter = shifted.to_bits() as u32;
        let r = (x - (shifted - TO_INTEGER) * FRAC_PI_2) as f32;
        let s = r * r;
        // Minimax polynomials on ±π/4 (Cephes).
        let sine = r + r * s * (-1.666_665_5e-1 + s * (8.332_161e-3 + s * -1.951_529_6e-4));
        let cosine =
            1.0 - 0.5 * s + s * s * (4.166_664_6e-2 + s * (-1.388_731_6e-3 + s * 2.443_315_7e-5));
        let (a, b) = if quarter & 1 == 1 {
            (cosine, sine)
        } else {
            (sine, cosine)
        };
        sines[i] = f32::from_bits(a.to_bits() ^ (quarter & 2) << 30);
        cosines[i] = f32::from_bits(b.to_bits() ^ (quarter.wrapping_add(1) & 2) << 30);
    }
    if angles.iter().any(|a| a.is_nan() | (a.abs() > LARGEST)) {
        for (i, angle) in angles.iter().enumerate() {
            if angle.is_nan() || angle.abs() > LARGEST {
                (sines[i], cosines[i]) = angle.sin_cos();
            }
        }
    }
    (sines, cosines)
}

/// Encodes `points` `[rows, 3]` into `to` `[rows, stride]`.
#[inline(always)]
pub(super) fn encode(angles: &Angles, points: &[f32], to: &mut [f32], stride: usize) {
    let count = angles.count;
    for (point, to) in points.chunks_exact(3).zip(to.chunks_exact_mut(stride)) {
        // A vector of lanes begins at x, y or z.
        let mut repeated = [0f32; LANES + 3];
        for (i, lane) in repeated.iter_mut().enumerate() {
            *lane = point[i % 3];
        }
        for first in (0..count).step_by(LANES) {
            let scales = &angles.scales[first..first + LANES];
            let window = &angles.window[first..first + LANES];
            let lanes = &repeated[first % 3..first % 3 + LANES];
            let phases: [f32; LANES] = std::array::from_fn(|i| lanes[i] * scales[i]);
            let (mut sines, mut cosines) = sines_cosines(&phases);
            for i in 0..LANES {
                sines[i] *= window[i];
                cosines[i] *= window[i];
            }
            let some = LANES.min(count - first);
            to[first..first + some].copy_from_slice(&sines[..some]);
            to[count + first..count + first + some].copy_from_slice(&cosines[..some]);
        }
        if angles.raw {
            to[2 * count..2 * count + 3].copy_from_slice(point);
        }
    }
}

/// Gradient to a point, from the row `encoded` that it was encoded in and the gradient `grad` to
/// that row.
#[inline(always)]
pub(super) fn encode_backward(angles: &Angles, encoded: &[f32], grad: &[f32]) -> [f32; 3] {
    let count = angles.count;
    let mut sums = [0f32; 3];
    if angles.raw {
        sums.copy_from_slice(&grad[2 * count..2 * count + 3]);
    }
    let (sines, cosines) = (&encoded[..count], &encoded[count..2 * count]);
    let (to_sines, to_cosines) = (&grad[..count], &grad[count..2 * count]);
    for band in (0..count).step_by(3) {
        for (c, sum) in sums.iter_mut().enumerate() {
            let i = band + c;
            // ∂L/∂x = Σ ω (cos(ω x) ∂L/∂sin − sin(ω x) ∂L/∂cos); the encoded values contain the window.
            *sum += angles.scales[i] * (cosines[i] * to_sines[i] - sines[i] * to_cosines[i]);
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg_attr(miri, ignore = "takes hours, and nothing here is unsafe")]
    fn sines_and_cosines_are_right_at_every_angle() {
        let mut worst = 0f64;
        let mut check = |angles: [f32; LANES]| {
            let (sines, cosines) = sines_cosines(&angles);
            for ((sine, cosine), angle) in sines.iter().zip(cosines).zip(angles) {
                let exact = f64::from(angle);
                worst = worst
                    .max((f64::from(*sine) - exact.sin()).abs())
                    .max((f64::from(cosine) - exact.cos()).abs());
            }
        };
        for exponent in -30..100 {
            for step in 0..64 {
                let base = 2f32.powi(exponent) * (1.0 + step as f32 / 64.0);
                check(std::array::from_fn(|i| {
                    base * (1.0 + i as f32 * 1e-3) * if i % 2 == 0 { 1.0 } else { -1.0 }
                }));
            }
        }
        // Near the multiples of π/2, where a careless reduction is wrong.
        for n in 0..100_000 {
            let near = (f64::from(n) * FRAC_PI_2) as f32;
            check(std::array::from_fn(|i| {
                f32::from_bits(near.to_bits().wrapping_add(i as u32))
            }));
        }
        assert!(worst < 1.2e-7, "{worst:e}");
    }

    #[test]
    fn sines_of_infinity_and_nan_are_nan() {
        let mut angles = [0.5f32; LANES];
        (angles[3], angles[7]) = (f32::NAN, f32::INFINITY);
        let (sines, cosines) = sines_cosines(&angles);
        for i in 0..LANES {
            let finite = i != 3 && i != 7;
            assert_eq!(sines[i].is_finite(), finite);
            assert_eq!(cosines[i].is_finite(), finite);
        }
    }
}
