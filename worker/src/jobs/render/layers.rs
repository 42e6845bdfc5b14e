//! Pictures of depth and opacity, in grey.

use super::models::Troupe;
use std::ops::Range;
use yoto_avatar::render::{Rendered, SceneView};
use yoto_capture::skeleton::transform::{dot, sub};
use yoto_proto::v1::Layer;

/// What people reach beyond their joints, metres.
const REACH: f64 = 0.35;
/// Nearest depth, metres.
const NEAREST: f64 = 0.01;
/// Least opacity of a pixel that has a depth: half of the light comes from the person.
const SOLID: f32 = 0.5;

/// What the pictures of a film show.
pub(super) enum Shown {
    Colours,
    Opacity,
    /// Metres from the nearest to the farthest depth of the whole film, so that people who approach
    /// become brighter.
    Depth(Range<f64>),
}

impl Shown {
    /// What `layer` shows of `views`.
    pub(super) fn new(layer: Layer, troupe: Troupe<'_>, views: &[SceneView]) -> Self {
        match layer {
            Layer::Unspecified => Self::Colours,
            Layer::Opacity => Self::Opacity,
            Layer::Depth => Self::Depth(depths(troupe, views)),
        }
    }

    /// The nearest and the farthest depth, metres; 0 of other pictures.
    pub(super) fn range(&self) -> [f64; 2] {
        match self {
            Self::Depth(range) => [range.start, range.end],
            Self::Colours | Self::Opacity => [0.0; 2],
        }
    }

    /// The picture of `frame`: `[H, W, 3]`.
    pub(super) fn rgb8(&self, frame: &Rendered) -> Vec<u8> {
        let grey = |values: &mut dyn Iterator<Item = u8>| values.flat_map(|v| [v; 3]).collect();
        match self {
            Self::Colours => frame.to_rgb8(),
            Self::Opacity => {
                let byte = |alpha: &f32| (alpha.clamp(0.0, 1.0) * 255.0).round() as u8;
                grey(&mut frame.alpha.iter().map(byte))
            }
            Self::Depth(range) => {
                let pixels = frame.depth.iter().zip(&frame.alpha);
                grey(&mut pixels.map(|(depth, alpha)| match *alpha >= SOLID {
                    true => brightness(f64::from(depth / alpha), range),
                    false => 0,
                }))
            }
        }
    }
}

/// 255 for the nearest depth, 1 for the farthest one.
fn brightness(depth: f64, range: &Range<f64>) -> u8 {
    let share = (range.end - depth) / (range.end - range.start);
    (1.0 + 254.0 * share.clamp(0.0, 1.0)).round() as u8
}

/// The depths between which all people of `views` are.
fn depths(troupe: Troupe<'_>, views: &[SceneView]) -> Range<f64> {
    let (mut near, mut far) = (f64::INFINITY, NEAREST);
    for view in views {
        let [x, y, z, _] = view.camera.e[2];
        for joint in troupe.joints(view) {
            let depth = dot([x, y, z], sub(joint, view.camera.centre()));
            near = near.min(depth - REACH);
            far = far.max(depth + REACH);
        }
    }
    let near = near.min(far).max(NEAREST);
    near..far.max(near + NEAREST)
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_synthetic::SyntheticPerson;

    #[test]
    fn near_is_bright_far_is_dark_and_nobody_is_black() {
        let view = SceneView {
            actors: Vec::new(),
            camera: SyntheticPerson::train_camera(2).resized(2, 2),
            background: [0.0; 3],
        };
        let frame = Rendered {
            // Half-opaque pixels have half of their depth in the sum.
            depth: vec![2.0, 1.0, 4.0, 0.3],
            alpha: vec![1.0, 0.5, 1.0, 0.1],
            ..Rendered::empty(&view)
        };
        let first = |rgb: Vec<u8>| -> Vec<u8> { rgb.iter().step_by(3).copied().collect() };
        let depth = Shown::Depth(2.0..4.0);
        assert_eq!(first(depth.rgb8(&frame)), [255, 255, 1, 0]);
        assert_eq!(depth.range(), [2.0, 4.0]);
        assert_eq!(first(Shown::Opacity.rgb8(&frame)), [255, 128, 255, 26]);
        assert_eq!(depth.rgb8(&frame).len(), 12);
        assert_eq!(brightness(3.0, &(2.0..4.0)), 128);
        assert_eq!(brightness(9.0, &(2.0..4.0)), 1);
    }
}
