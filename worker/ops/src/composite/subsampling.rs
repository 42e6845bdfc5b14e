//! Choice of the samples that a step learns from when all of them would take too long.
//!
//! The gradients of most samples are close to zero, namely in space that is known to be empty and of hidden
//! samples. The networks' backward pass takes as long for these as for any other sample. A
//! sample is therefore kept with a probability that rises with the size of its gradient, and the
//! gradient of a kept sample is divided by that probability, so that the expected gradient of
//! every parameter is unchanged (Russian roulette, Arvo and Kirk 1990). The price is variance.

use super::cpu::Gradients;

/// A random choice of samples whose gradients are kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GradientSubsampling {
    /// Expected share of the samples with a gradient that is kept; 1 or more keeps all.
    pub share: f32,
    /// Density per unit of the density field's output, 1/m. The size of a gradient to a density
    /// is measured at this output.
    pub density_scale: f32,
    /// Seed of the choice; different in each step.
    pub seed: u64,
}

/// Lower bound of the slope of the density's activation. A softplus needs none; a ReLU has slope 1
/// even where its density is close to 0, so that probabilities must not vanish there.
const FLOOR: f32 = 1e-2;
/// Halvings of the interval that holds the bound: its error is a millionth.
const HALVINGS: u32 = 20;

impl GradientSubsampling {
    /// Sets the gradients of the samples that are left out to 0 and scales the others up. `to` are the gradients to
    /// `rgb` `[n, 3]`, `density` `[n]` and `likelihood` `[n]`.
    pub(super) fn apply(
        &self,
        rgb: &[f32],
        density: &[f32],
        likelihood: &[f32],
        to: &mut Gradients,
    ) {
        if self.share >= 1.0 {
            return;
        }
        let sizes: Vec<f32> = (0..density.len())
            .map(|i| {
                let channels = 3 * i..3 * i + 3;
                let colour = rgb[channels.clone()].iter().zip(&to.rgb[channels]);
                // The gradient before the activation: a sigmoid c' = c (1 − c), a softplus, and a sum of softmax
                // weights.
                let colour: f32 = colour.map(|(c, g)| (g * c * (1.0 - c)).powi(2)).sum();
                let density = to.density[i] * self.slope(density[i]);
                let likelihood = to.likelihood[i] * likelihood[i];
                (colour + density.powi(2) + likelihood.powi(2)).sqrt()
            })
            .collect();
        let bound = bound(&sizes, self.share);
        for (i, size) in sizes.into_iter().enumerate() {
            // A NaN is kept, so that the check of the gradients finds it.
            if size >= bound || !size.is_finite() {
                continue;
            }
            let chance = size / bound;
            let factor = match uniform(self.seed, i as u64) < chance {
                true => 1.0 / chance,
                false => 0.0,
            };
            for g in &mut to.rgb[3 * i..3 * i + 3] {
                *g *= factor;
            }
            to.density[i] *= factor;
            to.likelihood[i] *= factor;
        }
    }

    /// Slope of the scaled softplus whose value is `density`, 1/m.
    fn slope(&self, density: f32) -> f32 {
        let share = 1.0 - (-density / self.density_scale).exp();
        self.density_scale * share.max(FLOOR)
    }
}

/// The size from which on samples are always kept, chosen so that the expected share of kept samples is `share`
/// among the samples whose size is above 0.
fn bound(sizes: &[f32], share: f32) -> f32 {
    let finite = || sizes.iter().copied().filter(|s| s.is_finite() && *s > 0.0);
    let wanted = f64::from(share) * finite().count() as f64;
    let (mut low, mut high) = (0f32, finite().fold(0.0, f32::max));
    // Under a bound of the largest size, chances are proportional to sizes; where that still keeps
    // too many samples, the bound must be larger than any size.
    while high > 0.0 && kept(finite(), high) > wanted && high < f32::MAX / 2.0 {
        high *= 2.0;
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if kept(finite(), middle) > wanted {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// Expected number of samples that are kept.
fn kept(sizes: impl Iterator<Item = f32>, bound: f32) -> f64 {
    sizes.map(|s| f64::from((s / bound).min(1.0))).sum()
}

/// A number in [0, 1): a hash of both arguments (SplitMix64), which does not depend on the order
/// of the work.
fn uniform(seed: u64, index: u64) -> f32 {
    let mut z = seed.wrapping_add(index.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ z >> 31) >> 40) as f32 / (1u64 << 24) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    const SAMPLES: usize = 400;

    /// Values and gradients whose sizes span two powers of ten.
    fn samples() -> (Vec<f32>, Vec<f32>, Vec<f32>, Gradients) {
        let wave = |i: usize, k: f32| 0.5 + 0.4 * (i as f32 * k).sin();
        let size = |i: usize| 10f32.powf(-2.0 * i as f32 / SAMPLES as f32);
        let rgb = (0..3 * SAMPLES).map(|i| wave(i, 0.7)).collect();
        let density = (0..SAMPLES).map(|i| 30.0 * wave(i, 1.3)).collect();
        let likelihood = (0..SAMPLES).map(|i| wave(i, 0.3)).collect();
        let gradients = Gradients {
            rgb: (0..3 * SAMPLES)
                .map(|i| size(i / 3) * (1.0 - 2.0 * wave(i, 2.1)))
                .collect(),
            density: (0..SAMPLES).map(|i| 1e-2 * size(i)).collect(),
            likelihood: (0..SAMPLES).map(|i| -size(i)).collect(),
        };
        (rgb, density, likelihood, gradients)
    }

    fn subsampled(share: f32, seed: u64) -> Gradients {
        let (rgb, density, likelihood, mut to) = samples();
        let subsampling = GradientSubsampling {
            share,
            density_scale: 50.0,
            seed,
        };
        subsampling.apply(&rgb, &density, &likelihood, &mut to);
        to
    }

    #[test]
    #[cfg_attr(miri, ignore = "takes hours, and nothing here is unsafe")]
    fn the_expected_gradient_is_the_whole_one() {
        const DRAWS: u64 = 4000;
        let whole = samples().3;
        let mut sums = vec![0f64; SAMPLES];
        let mut kept = 0usize;
        for seed in 0..DRAWS {
            let to = subsampled(0.1, seed * 977);
            kept += to.density.iter().filter(|g| **g != 0.0).count();
            for (sum, g) in sums.iter_mut().zip(&to.density) {
                *sum += f64::from(*g);
            }
        }
        let share = kept as f64 / (DRAWS as usize * SAMPLES) as f64;
        assert!((share - 0.1).abs() < 2e-3, "{share}");
        // The mean over the draws is close for a sum over samples, and may be far off for one sample.
        let groups = sums
            .chunks(SAMPLES / 8)
            .zip(whole.density.chunks(SAMPLES / 8));
        for (sums, whole) in groups {
            let mean = sums.iter().sum::<f64>() / DRAWS as f64;
            let whole: f64 = whole.iter().map(|g| f64::from(*g)).sum();
            assert!((mean / whole - 1.0).abs() < 0.1, "{mean} {whole}");
        }
    }

    #[test]
    fn all_gradients_of_a_sample_are_kept_or_none_and_large_ones_are_unchanged() {
        let (whole, to) = (samples().3, subsampled(0.25, 5));
        for i in 0..SAMPLES {
            let gone = to.density[i] == 0.0;
            assert_eq!(gone, to.likelihood[i] == 0.0, "{i}");
            assert_eq!(
                gone,
                to.rgb[3 * i..3 * i + 3].iter().all(|g| *g == 0.0),
                "{i}"
            );
            let factor = to.density[i] / whole.density[i];
            assert!(gone || factor > 0.999, "{i}: {factor}");
        }
        assert_eq!(to.density[0], whole.density[0]);
    }

    #[test]
    fn a_share_of_one_changes_nothing_and_nan_is_kept() {
        let (whole, to) = (samples().3, subsampled(1.0, 5));
        assert_eq!((to.rgb, to.density), (whole.rgb, whole.density));
        let (rgb, density, likelihood, mut to) = samples();
        to.density[SAMPLES - 1] = f32::NAN;
        let subsampling = GradientSubsampling {
            share: 0.01,
            density_scale: 50.0,
            seed: 1,
        };
        subsampling.apply(&rgb, &density, &likelihood, &mut to);
        assert!(to.density[SAMPLES - 1].is_nan());
        let mut nothing = Gradients {
            rgb: vec![0.0; 3],
            density: vec![0.0],
            likelihood: vec![0.0],
        };
        subsampling.apply(&[0.5; 3], &[1.0], &[1.0], &mut nothing);
        assert_eq!(nothing.density, [0.0]);
    }
}
