//! The Gaussian window of SSIM (Wang and others, 2004: 11 pixels, standard deviation 1.5) over whole pictures, by
//! rows and then columns. Outside, pictures are 0.

use crate::form::{Form, Work, multiply_add};
use rayon::prelude::*;

/// Side length, pixels, as in evaluation.
pub(super) const TAPS: usize = 11;
/// Pixels on each side of the centre.
pub(super) const RADIUS: usize = TAPS / 2;
/// Standard deviation, pixels.
const STD: f64 = 1.5;

/// Weights along one axis; they sum to 1.
pub(super) fn taps() -> [f32; TAPS] {
    let tap = |i: usize| (-(i as f64 - RADIUS as f64).powi(2) / (2.0 * STD * STD)).exp();
    let total: f64 = (0..TAPS).map(tap).sum();
    std::array::from_fn(|i| (tap(i) / total) as f32)
}

/// The means of `picture` under the window at each of its `width` x `height` pixels.
pub(super) fn blur(picture: &[f32], width: usize, height: usize) -> Vec<f32> {
    let taps = taps();
    // Rows of zeros above and below.
    let mut across = vec![0f32; width * (height + 2 * RADIUS)];
    across[RADIUS * width..][..width * height]
        .par_chunks_mut(width)
        .zip(picture.par_chunks(width))
        .with_min_len(16)
        .for_each_init(
            || vec![0f32; width + 2 * RADIUS],
            |padded, (out, row)| {
                padded[RADIUS..RADIUS + width].copy_from_slice(row);
                Form::best().run(WeightedSum {
                    taps: &taps,
                    from: padded,
                    stride: 1,
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
                stride: width,
                out,
            });
        });
    blurred
}

/// Writes `Σ taps[i] from[i · stride..]`: rows of numbers that begin `stride` numbers after each other.
struct WeightedSum<'a> {
    taps: &'a [f32; TAPS],
    from: &'a [f32],
    stride: usize,
    out: &'a mut [f32],
}

impl Work for WeightedSum<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        for (i, tap) in self.taps.iter().enumerate() {
            let row = &self.from[i * self.stride..][..self.out.len()];
            for (out, value) in self.out.iter_mut().zip(row) {
                *out = multiply_add::<FMA>(*tap, *value, *out);
            }
        }
    }
}
