//! Splats on the body's surface in place of the canonical field.

use super::ConfigError;
use serde::{Deserialize, Serialize};

/// Splats of each person, and their learning rates. Their loss is that of 3D Gaussian splatting:
/// 1 − λ of the mean absolute difference and λ of 1 − SSIM, of which λ is
/// [`OptimiseConfig::ssim_weight`](super::OptimiseConfig::ssim_weight).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SplatConfig {
    /// Number per person.
    pub count: usize,
    /// Learning rate of the places, metres.
    pub mean_rate: f64,
    /// Learning rate of the quaternions.
    pub turn_rate: f64,
    /// Learning rate of the scales' logarithms.
    pub scale_rate: f64,
    /// Learning rate of the opacities' logits.
    pub opacity_rate: f64,
    /// Learning rate of the colours.
    pub colour_rate: f64,
    /// Learning rate of the light; 0: none, so that colours have the light in them.
    pub light_rate: f64,
}

impl SplatConfig {
    /// Checks all fields.
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        let fail = |field, message: &str| {
            Err(ConfigError::Field {
                field,
                message: message.into(),
            })
        };
        if !(64..=1 << 20).contains(&self.count) {
            return fail("splats.count", "must be 64 to 1,048,576");
        }
        for (field, rate) in [
            ("splats.mean_rate", self.mean_rate),
            ("splats.turn_rate", self.turn_rate),
            ("splats.scale_rate", self.scale_rate),
            ("splats.opacity_rate", self.opacity_rate),
            ("splats.colour_rate", self.colour_rate),
            ("splats.light_rate", self.light_rate),
        ] {
            if !(rate.is_finite() && rate >= 0.0) {
                return fail(field, "must be at least 0");
            }
        }
        Ok(())
    }
}
