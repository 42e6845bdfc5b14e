//! Opacity of a sample, and the sums of a ray.

use super::OPAQUE;

/// Opacity of a sample of `density` 1/m, `step` metres long: (1 − exp(−σ δ)) m.
#[inline(always)]
pub fn opacity(density: f32, step: f32, likelihood: f32) -> f32 {
    (1.0 - (-density * step).exp()) * likelihood
}

/// Share of the light that passes a sample of opacity `alpha`, 1 − α + 1e-10. The sums must be in this
/// order: 1 + 1e-10 is 1 in f32.
#[inline(always)]
pub(super) fn transmitted(alpha: f32) -> f32 {
    1.0 - alpha + OPAQUE
}

/// The sums over the samples of a ray, near to far, over black.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayAccumulator {
    /// Σ T α c.
    pub rgb: [f32; 3],
    /// Σ T α.
    pub alpha: f32,
    /// Σ T α z, metres.
    pub depth: f32,
    /// T, the transmittance: the share of the light that passes all samples so far.
    pub transmittance: f32,
}

impl RayAccumulator {
    /// The sums before the first sample.
    pub const START: Self = Self {
        rgb: [0.0; 3],
        alpha: 0.0,
        depth: 0.0,
        transmittance: 1.0,
    };

    /// Adds a sample of opacity `alpha` behind the ones before. `rgb` has three channels, `depth`
    /// is in metres.
    #[inline(always)]
    pub fn add(&mut self, rgb: &[f32], alpha: f32, depth: f32) {
        // C += T α c, then T ← T (1 − α) (YOTO, eq. 9)
        let weight = self.transmittance * alpha;
        for (sum, channel) in self.rgb.iter_mut().zip(rgb) {
            *sum += weight * channel;
        }
        self.alpha += weight;
        self.depth += weight * depth;
        self.transmittance *= transmitted(alpha);
    }
}
