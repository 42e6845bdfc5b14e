//! Pose blend shapes of splats.

use super::{ConfigError, ModelConfig, Variant};
use serde::{Deserialize, Serialize};

/// Most shapes: players keep as many numbers per splat.
const MAX_COUNT: usize = 64;

/// Pose blend shapes of splats, and their learning rates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct PoseShapesConfig {
    /// Number of shapes; 0: bones alone move splats, as in models that were made without them.
    pub count: usize,
    /// Frequency bands of a place.
    pub bands: usize,
    /// Angular frequency of the first band, radians per metre.
    pub unit: f64,
    /// Hidden width of the network that chooses among shapes.
    pub width: usize,
    /// Distance from a joint and its bones at which its share has fallen to e^(−1/2), metres.
    pub reach: f64,
    /// Share of the run after which they take part.
    pub start: f64,
    /// Learning rate of the shapes, metres per unit of a rotation matrix.
    pub rate: f64,
    /// Learning rate of the network.
    pub network_rate: f64,
}

impl Default for PoseShapesConfig {
    fn default() -> Self {
        Self {
            count: 0,
            bands: 4,
            unit: 4.0,
            width: 64,
            reach: 0.12,
            start: 0.1,
            rate: 1e-4,
            network_rate: 1e-3,
        }
    }
}

impl PoseShapesConfig {
    /// The pose blend shapes of the tier `splat` (docs/research/splats-experiments.md has the experiments).
    pub(crate) fn of_tier() -> Self {
        Self {
            count: 8,
            ..Self::default()
        }
    }

    /// Checks all fields.
    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        let fail = |field, message: &str| {
            Err(ConfigError::Field {
                field,
                message: message.into(),
            })
        };
        if self.count > MAX_COUNT {
            return fail("splats.pose_shapes.count", "must be at most 64");
        }
        if !(1..=16).contains(&self.bands) {
            return fail("splats.pose_shapes.bands", "must be 1 to 16");
        }
        if !(1..=1024).contains(&self.width) {
            return fail("splats.pose_shapes.width", "must be 1 to 1,024");
        }
        for (field, value) in [
            ("splats.pose_shapes.unit", self.unit),
            ("splats.pose_shapes.reach", self.reach),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return fail(field, "must be above 0");
            }
        }
        if !(self.start.is_finite() && self.start >= 0.0) {
            return fail("splats.pose_shapes.start", "must be at least 0");
        }
        for (field, rate) in [
            ("splats.pose_shapes.rate", self.rate),
            ("splats.pose_shapes.network_rate", self.network_rate),
        ] {
            if !(rate.is_finite() && rate >= 0.0) {
                return fail(field, "must be at least 0");
            }
        }
        Ok(())
    }
}

impl ModelConfig {
    /// Pose blend shapes of the model's splats, if it has any. Without a pose condition, poses move bones alone.
    pub(crate) fn pose_shapes(&self) -> Option<&PoseShapesConfig> {
        let shapes = self.appearance.pose_shapes()?;
        (shapes.count > 0 && self.variant != Variant::NoPoseCondition).then_some(shapes)
    }

    /// Pose blend shapes that take part at `progress`.
    pub(crate) fn active_pose_shapes(&self, progress: f64) -> Option<&PoseShapesConfig> {
        self.pose_shapes().filter(|it| progress >= it.start)
    }
}
