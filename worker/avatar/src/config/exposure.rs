//! Exposure that changes while a film runs.

use super::ConfigError;
use serde::{Deserialize, Serialize};
use yoto_proto::v1::ExposureLearning;

/// The films whose exposures a training learns, frame by frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LearnExposure {
    /// No film: all frames count as exposed alike.
    #[default]
    Never,
    /// Exposures of captures whose frames differ by more than [`ExposureConfig::least`].
    Auto,
    /// All films.
    Always,
}

impl LearnExposure {
    /// The choice of an order; `None` leaves the choice to the configuration.
    pub fn ordered(order: ExposureLearning) -> Option<Self> {
        match order {
            ExposureLearning::Unspecified => None,
            ExposureLearning::Always => Some(Self::Always),
            ExposureLearning::Never => Some(Self::Never),
            ExposureLearning::Auto => Some(Self::Auto),
        }
    }
}

/// Learning of a gain and an offset of each training frame and colour channel, as a camera changes them
/// that adjusts itself while it films. They belong to the frames, not to the model: renders are exposed
/// like the mean of all frames. Chosen by experiment (docs/research/exposure.md).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ExposureConfig {
    /// Captures whose exposures are learned.
    pub who: LearnExposure,
    /// Share of the run after which exposures are fitted: before, the model's colours are too rough.
    pub start: f64,
    /// Share of the run after which, for `auto`, the films with learned exposures are chosen.
    pub decide: f64,
    /// Root mean square of the gains' logarithms from which on a film's exposures are learned, for
    /// `auto`.
    pub least: f64,
    /// Expected difference of a gain from 1.
    pub gain: f64,
    /// Expected offset, of colours up to 1.
    pub offset: f64,
    /// Expected difference of the mean of a few pixels from the model's where the exposure is right.
    pub noise: f64,
    /// Share of the difference to the fitted exposure by which an exposure moves.
    pub share: f64,
}

impl Default for ExposureConfig {
    /// A configuration that learns no exposures.
    fn default() -> Self {
        Self {
            who: LearnExposure::Never,
            start: 0.02,
            decide: 0.2,
            least: 0.08,
            gain: 0.2,
            offset: 0.02,
            noise: 0.1,
            share: 1.0,
        }
    }
}

impl ExposureConfig {
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
        for (field, share) in [
            ("exposure.start", self.start),
            ("exposure.decide", self.decide),
            ("exposure.share", self.share),
        ] {
            if !(0.0..=1.0).contains(&share) {
                return wrong(field, "must be between 0 and 1");
            }
        }
        if self.start > self.decide {
            return wrong("exposure.decide", "must not come before exposure.start");
        }
        if !(0.0..=10.0).contains(&self.least) {
            return wrong("exposure.least", "must be between 0 and 10");
        }
        for (field, value) in [
            ("exposure.gain", self.gain),
            ("exposure.offset", self.offset),
            ("exposure.noise", self.noise),
        ] {
            if !(1e-6..=1e3).contains(&value) {
                return wrong(field, "must be between 1e-6 and 1000");
            }
        }
        Ok(())
    }
}
