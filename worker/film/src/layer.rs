//! What the pictures show: colours, opacity or depth.

use crate::bodies::Bodies;
use crate::plan::View;
use std::ops::Range;
use yoto_capture::skeleton::transform::{dot, sub};
use yoto_proto::v1;

/// What people reach beyond their joints, metres.
const REACH: f64 = 0.35;
/// Nearest depth, metres.
const NEAREST: f64 = 0.01;

/// What the pictures of a render show.
#[derive(Clone, Debug, PartialEq)]
pub enum Layer {
    /// The people as the camera sees them.
    Colours,
    /// The share of light that they stop.
    Opacity,
    /// Distance along the camera's axis. Metres from the nearest to the farthest depth of all pictures, so that
    /// people who approach become brighter.
    Depth(Range<f64>),
}

impl Layer {
    pub(crate) fn new(layer: v1::Layer, bodies: &Bodies, views: &[View]) -> Self {
        match layer {
            v1::Layer::Unspecified => Self::Colours,
            v1::Layer::Opacity => Self::Opacity,
            v1::Layer::Depth => Self::Depth(depths(bodies, views)),
        }
    }

    /// The nearest and the farthest depth, metres; `None` for other layers.
    pub fn range(&self) -> Option<[f64; 2]> {
        match self {
            Self::Depth(range) => Some([range.start, range.end]),
            Self::Colours | Self::Opacity => None,
        }
    }
}

/// The depths between which all people of `views` are.
fn depths(bodies: &Bodies, views: &[View]) -> Range<f64> {
    let (mut near, mut far) = (f64::INFINITY, NEAREST);
    for view in views {
        let [x, y, z, _] = view.camera.e[2];
        for joint in bodies.joints(view) {
            let depth = dot([x, y, z], sub(joint, view.camera.centre()));
            near = near.min(depth - REACH);
            far = far.max(depth + REACH);
        }
    }
    let near = near.min(far).max(NEAREST);
    near..far.max(near + NEAREST)
}
