//! Settings of a frame that replace those of the model's configuration: the ones that trade time
//! for fidelity without retraining.

use super::RenderError;
use crate::config::{ConfigError, ModelConfig, Precision};
use serde::{Deserialize, Serialize};
use yoto_proto::v1;

/// Samples per ray, epsilon and least transmittance that models without rays report: nothing reads these numbers.
const WITHOUT_RAYS: (usize, f32, f32) = (64, 1e-3, 1e-3);
/// Smallest scale: below it, a person covers only a few pixels.
const SMALLEST_SCALE: f32 = 0.05;

/// Settings of a frame. Each field is an axis of the trade-off, with a list of values in
/// [`crate::tradeoff::Axes`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RenderSettings {
    /// Samples per ray.
    pub samples: usize,
    /// Samples with a foreground likelihood below this are not evaluated.
    pub epsilon: f32,
    /// Transmittance below which a ray ends; 0: rays never end early.
    #[serde(default)]
    pub min_transmittance: f32,
    /// Precision of the factors in the fields' networks.
    #[serde(default)]
    pub precision: Precision,
    /// Width and height of the rendered frame relative to the requested ones, 0.05 to 1. The
    /// result is enlarged to full size, so that frames of all scales can be compared.
    #[serde(default = "whole")]
    pub scale: f32,
    /// Number of splats of each person, as a share of those that can be seen: above 0 and at most 1. Models with a field
    /// have 1.
    #[serde(default = "whole")]
    pub splats: f32,
}

fn whole() -> f32 {
    1.0
}

impl RenderSettings {
    /// A model's default settings: those of its configuration, at full size.
    pub fn of(config: &ModelConfig) -> Self {
        let (samples, epsilon, min_transmittance) = match config.appearance.march() {
            Some(march) => (march.samples, march.epsilon, march.min_transmittance),
            None => WITHOUT_RAYS,
        };
        Self {
            samples,
            epsilon,
            min_transmittance,
            precision: config.precision,
            scale: whole(),
            splats: whole(),
        }
    }

    /// Checks all fields.
    ///
    /// # Errors
    /// Names the first field that is out of its range.
    pub fn check(&self) -> Result<(), ConfigError> {
        let fail = |field, message: &str| {
            Err(ConfigError::Field {
                field,
                message: message.into(),
            })
        };
        if !(2..=4096).contains(&self.samples) {
            return fail("settings.samples", "must be 2 to 4096");
        }
        if !(0.0..1.0).contains(&self.epsilon) {
            return fail("settings.epsilon", "must be in [0, 1)");
        }
        if !(0.0..1.0).contains(&self.min_transmittance) {
            return fail("settings.min_transmittance", "must be in [0, 1)");
        }
        if !(SMALLEST_SCALE..=1.0).contains(&self.scale) {
            return fail("settings.scale", "must be 0.05 to 1");
        }
        // Comparisons are false for a NaN.
        if !(self.splats > 0.0 && self.splats <= 1.0) {
            return fail("settings.splats", "must be above 0 and at most 1");
        }
        Ok(())
    }

    /// Replaces those of these settings that `config` has.
    pub(super) fn apply(&self, config: &mut ModelConfig) {
        if let Some(march) = config.appearance.march_mut() {
            march.samples = self.samples;
            march.epsilon = self.epsilon;
            march.min_transmittance = self.min_transmittance;
        }
        config.precision = self.precision;
    }

    /// Rendered size of a frame of `width` by `height` pixels.
    pub(super) fn rendered_size(&self, width: u32, height: u32) -> (u32, u32) {
        let side = |full: u32| ((f64::from(full) * f64::from(self.scale)).round() as u32).max(1);
        (side(width), side(height))
    }
}

impl From<&RenderSettings> for v1::RenderSettings {
    fn from(settings: &RenderSettings) -> Self {
        Self {
            // Checked settings have at most 4096.
            samples: u32::try_from(settings.samples).unwrap_or(u32::MAX),
            epsilon: settings.epsilon,
            min_transmittance: settings.min_transmittance,
            bf16: settings.precision == Precision::Bf16,
            scale: settings.scale,
            splats: settings.splats,
        }
    }
}

impl From<ConfigError> for RenderError {
    fn from(error: ConfigError) -> Self {
        Self::Settings(error.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_that_render_nothing_are_named() {
        let config = ModelConfig::named("fast", "yoto").expect("named");
        let own = RenderSettings::of(&config);
        assert_eq!(own.check(), Ok(()));
        type Change = fn(&mut RenderSettings);
        let cases: [(Change, &str); 11] = [
            (
                |it| it.min_transmittance = 1.0,
                "settings.min_transmittance",
            ),
            (
                |it| it.min_transmittance = f32::NAN,
                "settings.min_transmittance",
            ),
            (|it| it.samples = 1, "settings.samples"),
            (|it| it.epsilon = 1.0, "settings.epsilon"),
            (|it| it.epsilon = f32::NAN, "settings.epsilon"),
            (|it| it.scale = 0.0, "settings.scale"),
            (|it| it.scale = 1.5, "settings.scale"),
            (|it| it.scale = f32::NAN, "settings.scale"),
            (|it| it.splats = 0.0, "settings.splats"),
            (|it| it.splats = 1.01, "settings.splats"),
            (|it| it.splats = f32::NAN, "settings.splats"),
        ];
        for (change, field) in cases {
            let mut bad = own;
            change(&mut bad);
            let error = bad.check().expect_err(field).to_string();
            assert!(error.starts_with(field), "{error}");
        }
    }

    #[test]
    fn a_small_frame_keeps_a_pixel() {
        let settings = RenderSettings {
            scale: 0.25,
            ..RenderSettings::of(&ModelConfig::named("draft", "yoto").expect("named"))
        };
        assert_eq!(settings.rendered_size(128, 2), (32, 1));
    }
}
