//! The plan of a render.

use crate::layer::Layer;
use crate::surroundings::Surroundings;
use crate::truth::Truth;
use yoto_capture::camera::{Camera, Pose};
use yoto_proto::v1::RenderSpec;

/// Frames per second of an animation that has no speed of its own.
pub(crate) const FPS: f32 = 15.0;
/// The fastest animation, frames per second: browsers show APNGs of at most this many.
pub const MAX_FPS: f32 = 1000.0;

/// All pictures of a render.
#[derive(Debug)]
pub struct Plan {
    /// The pictures, in their order.
    pub views: Vec<View>,
    /// What they show.
    pub layer: Layer,
    /// What is behind the people, if not the views' own background.
    pub surroundings: Option<Surroundings>,
    /// The filmed pictures, if the render repeats some.
    pub truth: Option<Truth>,
    /// Frames per second of the animation.
    pub fps: f32,
}

/// One picture.
#[derive(Clone, Debug)]
pub struct View {
    /// The people, in any order.
    pub actors: Vec<Actor>,
    /// Camera, with the size of the picture.
    pub camera: Camera,
    /// Linear rgb in [0, 1].
    pub background: [f32; 3],
    /// If the people cast a shadow: a camera above that sees all of them.
    pub shadow: Option<Camera>,
}

/// A person of a picture.
#[derive(Clone, Debug)]
pub struct Actor {
    /// Index of the model that draws them in [`Bodies::models`](crate::Bodies::models); a renderer of one model does not
    /// read it.
    pub model: usize,
    /// Slot of the identity in that model.
    pub slot: usize,
    /// Pose of the body.
    pub pose: Pose,
    /// Light on the person.
    pub light: Light,
}

/// Light on a person. Fields have it in their colours, so that models of splats alone can be lit
/// otherwise.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Light {
    /// The light of the person's own capture, in whose world they stand.
    #[default]
    Own,
    /// No light: colours alone.
    Neutral,
    /// The light of another capture.
    Of {
        /// Slot of the capture's identity.
        slot: usize,
        /// Rotation from the view's world to that of the capture.
        rotation: [[f32; 3]; 3],
    },
}

/// The colour behind everybody.
pub(crate) fn background(spec: &RenderSpec) -> [f32; 3] {
    spec.background.as_slice().try_into().unwrap_or([0.0; 3])
}

/// Frames per second of the animation, if the request says it.
pub(crate) fn wanted_fps(spec: &RenderSpec) -> Option<f32> {
    (spec.fps != 0.0).then_some(spec.fps)
}
