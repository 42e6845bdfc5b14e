//! Splats on the body's surface in place of the canonical field.

use super::{ConfigError, PoseShapesConfig};
use serde::{Deserialize, Serialize};

/// Highest degree of harmonics.
const MAX_DEGREE: usize = 2;

/// Splats of each person, and their learning rates. Their loss is that of 3D Gaussian splatting:
/// 1 − λ of the mean absolute difference and λ of 1 − SSIM, of which λ is
/// [`OptimiseConfig::ssim_weight`](super::OptimiseConfig::ssim_weight).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct SplatConfig {
    /// Number per person.
    pub count: usize,
    /// Number at first where poses are refined widely, at most `count`: few large splats fit inexact
    /// poses better than many small ones.
    pub coarse: usize,
    /// Where poses are refined widely: share of the run after which splats are split until there are as many
    /// as the geometric mean of `coarse` and `count`.
    pub grow: f64,
    /// Where poses are refined widely: share of the run after which they are split until there are `count`.
    pub grow_all: f64,
    /// Learning rate of the means, metres.
    pub mean_rate: f64,
    /// Learning rate of the rotations, which are quaternions. Configurations call it `turn_rate`.
    #[serde(rename = "turn_rate")]
    pub rotation_rate: f64,
    /// Learning rate of the scales' logarithms.
    pub scale_rate: f64,
    /// Learning rate of the opacities' logits.
    pub opacity_rate: f64,
    /// Learning rate of the colours.
    pub colour_rate: f64,
    /// Degree of the spherical harmonics by which colours depend on the view: 0, not at all, to 2.
    pub harmonics: usize,
    /// Learning rate of their coefficients.
    pub harmonic_rate: f64,
    /// Whether the colours of splats that no training frame shows are guessed at the end of a run.
    pub guess_unseen: bool,
    /// Learning rate of the light; 0: none, so that colours have the light in them.
    pub light_rate: f64,
    /// Whether splats start on the surface of the shared body, whose bones carry them (docs/research/body.md).
    pub surface: bool,
    /// Pose blend shapes.
    pub pose_shapes: PoseShapesConfig,
}

impl Default for SplatConfig {
    /// Chosen by experiment (docs/research/splats-experiments.md).
    fn default() -> Self {
        Self {
            count: 20_000,
            coarse: 4_000,
            grow: 0.3,
            grow_all: 0.5,
            mean_rate: 1e-3,
            rotation_rate: 1e-2,
            scale_rate: 1e-2,
            opacity_rate: 5e-2,
            colour_rate: 8e-3,
            harmonics: 0,
            harmonic_rate: 4e-4,
            light_rate: 5e-3,
            guess_unseen: true,
            surface: true,
            pose_shapes: PoseShapesConfig::default(),
        }
    }
}

impl SplatConfig {
    /// Number at first, where poses are refined.
    pub(crate) fn initial_count(&self) -> usize {
        self.coarse.min(self.count)
    }

    /// Checks all fields.
    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        let fail = |field, message: &str| {
            Err(ConfigError::Field {
                field,
                message: message.into(),
            })
        };
        if !(64..=1 << 20).contains(&self.count) {
            return fail("splats.count", "must be 64 to 1,048,576");
        }
        if self.harmonics > MAX_DEGREE {
            return fail("splats.harmonics", "must be 0, 1 or 2");
        }
        if self.coarse < 64 {
            return fail("splats.coarse", "must be at least 64");
        }
        for (field, share) in [
            ("splats.grow", self.grow),
            ("splats.grow_all", self.grow_all),
        ] {
            if !(0.0..1.0).contains(&share) {
                return fail(field, "must be at least 0 and less than 1");
            }
        }
        if self.grow > self.grow_all {
            return fail("splats.grow", "must be at most splats.grow_all");
        }
        for (field, rate) in [
            ("splats.mean_rate", self.mean_rate),
            ("splats.turn_rate", self.rotation_rate),
            ("splats.scale_rate", self.scale_rate),
            ("splats.opacity_rate", self.opacity_rate),
            ("splats.colour_rate", self.colour_rate),
            ("splats.harmonic_rate", self.harmonic_rate),
            ("splats.light_rate", self.light_rate),
        ] {
            if !(rate.is_finite() && rate >= 0.0) {
                return fail(field, "must be at least 0");
            }
        }
        self.pose_shapes.check()
    }
}
