//! The Gaussian window of SSIM over whole pictures, by rows and columns. Outside, pictures are 0.

use crate::form::{Form, Work, multiply_add};
use rayon::prelude::*;

/// Side length, pixels (Wang and others, 2004, as in evaluation).
pub(super) const TAPS: usize = 11;
/// Pixels on each side of the middle.
pub(super) const HALF: usize = TAPS / 2;
/// Standard deviation, pixels.
const STD: f64 = 1.5;

/// Weights along one axis; they sum to 1.
pub(super) fn taps() -> [f32; TAPS] {
    let tap = |i: usize| (-(i as f64 - HALF as f64).powi(2) / (2.0 * STD * STD)).exp();
    let total: f64 = (0..TAPS).map(tap).sum();
    std::array::from_fn(|i| (tap(i) / total) as f32)
}

/// The means of `picture` under the window at each of its `width` x `height` pixels.
pub(super) fn blur(picture: &[f32], width: usize, height: usize) -> Vec<f32> {
    let taps = taps();
    // Rows of zeros above and below.
    let mut across = vec![0f32; width * (height + 2 * HALF)];
    across[HALF * width..][..width * height]
        .par_chunks_mut(width)
        .zip(picture.par_chunks(width))
        .with_min_len(16)
        .for_each_init(
            || vec![0f32; width + 2 * HALF],
            |padded, (out, row)| {
                padded[HALF..HALF + width].copy_from_slice(row);
                Form::best().run(WeightedSum {
                    taps: &taps,
                    from: padded,
                    apart: 1,
                    out,
                });
            },
        );
    let mut blurred = vec![0f32; width * height];
    blurred
        .par_chunks_mut(width)
        .enumerate()
        .with_min_len(16)
        .for_each(|(y, out)| {
            Form::best().run(WeightedSum {
                taps: &taps,
                from: &across[y * width..],
                apart: width,
                out,
            });
        });
    blurred
}

/// Adds up rows of numbers that begin `apart` numbers from each other.
struct WeightedSum<'a> {
    taps: &'a [f32; TAPS],
    from: &'a [f32],
    apart: usize,
    out: &'a mut [f32],
}

impl Work for WeightedSum<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        for (i, tap) in self.taps.iter().enumerate() {
            let row = &self.from[i * self.apart..][..self.out.len()];
            for (out, value) in self.out.iter_mut().zip(row) {
                *out = multiply_add::<FMA>(*tap, *value, *out);
            }
        }
    }
}
