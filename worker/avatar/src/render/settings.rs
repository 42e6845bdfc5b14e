//! What a frame may be rendered with in place of the model's own configuration: the dials that
//! trade seconds for fidelity without training anything anew.

use super::RenderError;
use crate::config::{ConfigError, ModelConfig, Precision};
use serde::{Deserialize, Serialize};
use yoto_proto::v1;

/// Smallest share of the resolution that is rendered: under it a person is a few pixels.
const SMALLEST_SCALE: f32 = 0.05;

/// The dials of a frame. An axis of the trade-off is a field here and a line in
/// [`crate::tradeoff::Axes`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RenderSettings {
    /// Samples a ray.
    pub samples: usize,
    /// A sample with a foreground likelihood under this is not evaluated.
    pub epsilon: f32,
    /// A ray ends where less light than this comes through; 0: none does.
    #[serde(default)]
    pub min_transmittance: f32,
    /// What the fields' networks multiply in.
    #[serde(default)]
    pub precision: Precision,
    /// Share of the frame's width and height that is rendered, (0, 1]; the result is brought
    /// back to full size, so that frames of all scales compare.
    #[serde(default = "whole")]
    pub scale: f32,
}

fn whole() -> f32 {
    1.0
}

impl RenderSettings {
    /// What a model renders with unless told otherwise: its configuration, at full size.
    pub fn of(config: &ModelConfig) -> Self {
        Self {
            samples: config.march.samples,
            epsilon: config.march.epsilon,
            min_transmittance: config.march.min_transmittance,
            precision: config.precision,
            scale: whole(),
        }
    }

    /// # Errors
    /// Names the first field that no frame can be rendered with.
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
        Ok(())
    }

    /// Puts the dials that the configuration has into it.
    pub(super) fn apply(&self, config: &mut ModelConfig) {
        config.march.samples = self.samples;
        config.march.epsilon = self.epsilon;
        config.march.min_transmittance = self.min_transmittance;
        config.precision = self.precision;
    }

    /// The size that is rendered for a frame of `width` by `height` pixels.
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
        let cases: [(Change, &str); 8] = [
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
