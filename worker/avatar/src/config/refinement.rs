//! Refinement of the poses of training frames.

use super::{ConfigError, ModelConfig, Schedule};
use serde::{Deserialize, Serialize};

/// Refinement of the poses of training frames: changes of every joint's rotation, the root's too,
/// and of the root's place, which are learned with the model. They belong to a training, not to
/// the model: renders take poses as they are given.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RefinementConfig {
    /// Learning rate of rotations, radians; 0: poses stay as they are given.
    pub rotation_rate: f64,
    /// Learning rate of the root's place, metres.
    pub place_rate: f64,
    /// Start, as a share of the run.
    pub start: f64,
    /// Frames from one knot to the next: changes are linear in time between knots, so that a step
    /// on one frame also teaches its neighbours.
    pub spacing: usize,
}

impl Default for RefinementConfig {
    /// No refinement.
    fn default() -> Self {
        Self {
            rotation_rate: 0.0,
            place_rate: 0.0,
            ..Self::of_estimates()
        }
    }
}

impl ModelConfig {
    /// This configuration with refined poses, in place of the network that corrects them.
    pub fn refining_poses(mut self) -> Self {
        self.refinement = RefinementConfig::of_estimates();
        self.schedule.correction = Schedule::NEVER;
        self
    }
}

impl RefinementConfig {
    /// For poses that were estimated (docs/refinement.md).
    pub fn of_estimates() -> Self {
        Self {
            rotation_rate: 1e-2,
            place_rate: 2e-3,
            start: 0.05,
            spacing: 2,
        }
    }

    /// Whether poses are refined at all.
    pub fn is_on(&self) -> bool {
        self.rotation_rate > 0.0 || self.place_rate > 0.0
    }

    /// Whether poses are refined after the completed fraction `progress` of a run.
    pub fn refines(&self, progress: f64) -> bool {
        self.is_on() && progress >= self.start
    }

    /// Checks every field.
    ///
    /// # Errors
    /// The first one that is out of its range.
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        let wrong = |field, message: &str| {
            Err(ConfigError::Field {
                field,
                message: message.into(),
            })
        };
        for (field, rate) in [
            ("refinement.rotation_rate", self.rotation_rate),
            ("refinement.place_rate", self.place_rate),
        ] {
            if !(rate.is_finite() && rate >= 0.0) {
                return wrong(field, "must be 0 or more");
            }
        }
        if !(0.0..=1.0).contains(&self.start) {
            return wrong("refinement.start", "must be between 0 and 1");
        }
        if self.spacing == 0 {
            return wrong("refinement.spacing", "must be at least 1 frame");
        }
        Ok(())
    }
}
