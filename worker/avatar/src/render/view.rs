//! Views to render: one person, or several in one picture.

use super::frame::{RenderError, Renderer};
use crate::motion::body::CanonicalBody;
use yoto_capture::body_box::BodyView;
use yoto_capture::camera::{Camera, Pose};
pub use yoto_film::{Actor, Light};

/// A view of one person, in the light of their own capture.
#[derive(Clone, Debug)]
pub struct RenderView {
    /// Slot of the identity.
    pub slot: usize,
    /// Pose of the body.
    pub pose: Pose,
    /// Camera, with the size of the frame.
    pub camera: Camera,
    /// Linear rgb in [0, 1].
    pub background: [f32; 3],
}

/// A view of several people, who hide each other.
#[derive(Clone, Debug)]
pub struct SceneView {
    /// The people, in any order.
    pub actors: Vec<Actor>,
    /// Camera, with the size of the frame.
    pub camera: Camera,
    /// Linear rgb in [0, 1].
    pub background: [f32; 3],
}

impl From<RenderView> for SceneView {
    fn from(view: RenderView) -> Self {
        let RenderView {
            slot,
            pose,
            camera,
            background,
        } = view;
        Self {
            actors: vec![Actor {
                model: 0,
                slot,
                pose,
                light: Light::Own,
            }],
            camera,
            background,
        }
    }
}

/// An actor with their body.
#[derive(Clone, Copy)]
pub(super) struct ActorBody<'a> {
    pub actor: &'a Actor,
    pub body: &'a CanonicalBody,
}

impl Renderer {
    /// Whether people can be lit otherwise than in their captures.
    pub fn has_light(&self) -> bool {
        self.config().appearance.capabilities().light
    }

    /// The actors of a view with their bodies, once the view is checked.
    pub(super) fn actor_bodies<'a>(
        &'a self,
        view: &'a SceneView,
    ) -> Result<Vec<ActorBody<'a>>, RenderError> {
        let camera = &view.camera;
        let mut numbers = camera
            .k
            .as_flattened()
            .iter()
            .chain(camera.e.as_flattened());
        if !numbers.all(|v| v.is_finite()) {
            return Err(RenderError::NotFinite("camera"));
        }
        let actor_body = |actor: &'a Actor| {
            if actor.light != Light::Own && !self.has_light() {
                return Err(RenderError::NoLight);
            }
            let body = self.body_in(actor.slot, &actor.pose)?;
            Ok(ActorBody { actor, body })
        };
        view.actors.iter().map(actor_body).collect()
    }

    /// Number of rays of a view that meet a body's box, which determines the time of a frame; a ray
    /// counts once per box. They are counted at the size of the view, whatever the scale it is rendered
    /// at.
    ///
    /// # Errors
    /// As [`Self::render_scene`].
    pub fn rays(&self, view: &SceneView) -> Result<usize, RenderError> {
        let (width, height) = (view.camera.width as usize, view.camera.height as usize);
        let of = |actor_body: &ActorBody<'_>| {
            let body_view = BodyView::new(
                &actor_body.body.skeleton,
                &actor_body.actor.pose,
                &view.camera,
            );
            (0..width * height)
                .filter(|i| {
                    body_view
                        .ray((i % width) as f64 + 0.5, (i / width) as f64 + 0.5)
                        .is_some()
                })
                .count()
        };
        Ok(self.actor_bodies(view)?.iter().map(of).sum())
    }
}
