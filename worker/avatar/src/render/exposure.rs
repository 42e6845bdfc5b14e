//! The exposure of a frame relative to the other frames of its capture.

use super::frame::Rendered;
use serde::{Deserialize, Serialize};

/// A gain and an offset of each colour channel: the person's colour c shows as `gain · c + offset`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameExposure {
    /// Factors of red, green and blue.
    pub gain: [f32; 3],
    /// Offsets of red, green and blue, of colours up to 1.
    pub offset: [f32; 3],
}

impl FrameExposure {
    /// The mean exposure of the capture.
    pub const NEUTRAL: Self = Self {
        gain: [1.0; 3],
        offset: [0.0; 3],
    };

    /// The exposure at the share `at` of the way to `other`.
    pub(crate) fn towards(&self, other: &Self, at: f32) -> Self {
        let mix = |a: [f32; 3], b: [f32; 3]| std::array::from_fn(|c| a[c] + at * (b[c] - a[c]));
        Self {
            gain: mix(self.gain, other.gain),
            offset: mix(self.offset, other.offset),
        }
    }

    /// Exposes a picture of people over black.
    pub fn expose(&self, picture: &mut Rendered) {
        if *self == Self::NEUTRAL {
            return;
        }
        let pixels = picture.rgb.as_chunks_mut::<3>().0.iter_mut();
        for (rgb, alpha) in pixels.zip(&picture.alpha) {
            for (c, value) in rgb.iter_mut().enumerate() {
                *value = (self.gain[c] * *value + self.offset[c] * alpha).clamp(0.0, 1.0);
            }
        }
    }
}
