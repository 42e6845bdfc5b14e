//! Frames of models that consist of splats.

use super::frame::{RenderError, Rendered, Renderer};
use super::view::{ActorBody, Light, SceneView};
use crate::avatar::AvatarSplats;
use crate::host::read;
use crate::motion::body::CanonicalBody;
use crate::motion::posed::pose_vector;
use rayon::prelude::*;
use std::borrow::Cow;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;
use yoto_ops::splat::cpu::SplatSlices;
use yoto_ops::splat::light::LIGHTS;
use yoto_ops::splat::{Splats, View, render};

/// Pixels per task.
const ROW: usize = 8192;

/// `camera` in the frame of a body in `pose`.
pub(crate) fn body_view(skeleton: &Skeleton, pose: &Pose, camera: &Camera) -> View {
    let to_world = skeleton.body_to_world(pose);
    let inside = camera.in_frame(&to_world);
    let row = |row: &[f64]| -> [f32; 3] { std::array::from_fn(|c| row[c] as f32) };
    View {
        width: camera.width as usize,
        height: camera.height as usize,
        k: [row(&inside.k[0]), row(&inside.k[1])],
        e: std::array::from_fn(|r| inside.e[r].map(|v| v as f32)),
        world: std::array::from_fn(|r| row(&to_world[r])),
    }
}

/// [`Splats`] in host memory.
pub(crate) struct HostSplats<'a> {
    transforms: Vec<f32>,
    rows: Cow<'a, [f32]>,
    light: Cow<'a, [f32]>,
}

impl HostSplats<'_> {
    /// Reads `splats` from their device, with the colours that the camera sees.
    pub(crate) fn read(splats: Splats, body_view: &View) -> Result<Self, RenderError> {
        let splats = splats.with_view_colours(body_view);
        Ok(Self {
            rows: read(splats.rows().detach())?.into(),
            transforms: read(splats.transforms.detach())?,
            light: read(splats.light.detach())?.into(),
        })
    }

    /// The numbers as [`render`] takes them.
    pub(crate) fn as_slices(&self) -> SplatSlices<'_> {
        SplatSlices {
            transforms: &self.transforms,
            rows: &self.rows,
            light: &self.light,
        }
    }
}

/// The splats of `people` over the background of `view`, in one pass.
pub(super) fn blended(people: &[(HostSplats<'_>, View)], view: &SceneView) -> Rendered {
    let parts: Vec<_> = people
        .iter()
        .map(|(it, body_view)| (it.as_slices(), body_view))
        .collect();
    let mut frame = Rendered::empty(view);
    let Some(mut drawn) = render(&parts) else {
        return frame;
    };
    let pixels = drawn.rgb.as_chunks_mut::<3>().0;
    let rows = pixels.par_chunks_mut(ROW).zip(drawn.alpha.par_chunks(ROW));
    rows.for_each(|(pixels, alphas)| {
        for (rgb, alpha) in pixels.iter_mut().zip(alphas) {
            for (value, background) in rgb.iter_mut().zip(view.background) {
                *value = (*value + (1.0 - alpha) * background).clamp(0.0, 1.0);
            }
        }
    });
    frame.rgb = drawn.rgb;
    frame.alpha = drawn.alpha;
    frame.depth = drawn.depth;
    frame
}

impl Renderer {
    /// Renders a view of people that consist of splats, all in one pass, so that they hide each other.
    pub(super) fn render_splats(
        &self,
        splats: AvatarSplats<'_>,
        actors: &[ActorBody<'_>],
        view: &SceneView,
    ) -> Result<Rendered, RenderError> {
        let people = actors
            .iter()
            .map(|actor_body| self.actor_splats(splats, actor_body, view));
        Ok(blended(&people.collect::<Result<Vec<_>, _>>()?, view))
    }

    /// The splats of the identity in `slot` in a pose, as the camera sees them.
    fn posed(
        &self,
        splats: AvatarSplats<'_>,
        slot: usize,
        body: &CanonicalBody,
        pose: &Pose,
        body_view: &View,
    ) -> Result<HostSplats<'_>, RenderError> {
        if let Some(rest) = self.rest_splats(splats, slot, body)? {
            let vector = pose_vector(body, pose);
            let bones =
                (self.avatar).bones(&self.config, body, pose, vector, self.schedule_progress);
            let transforms = rest.skin(&read(bones)?);
            return Ok(HostSplats {
                rows: rest.rows_for_view(body_view, pose, &transforms),
                transforms,
                light: Cow::Borrowed(&rest.light),
            });
        }
        let posed = (self.avatar).pose(&self.config, body, slot, pose, self.schedule_progress);
        HostSplats::read(splats.posed_splats(body, &posed)?, body_view)
    }

    /// The splats of an actor in the light of the scene, and the camera in their body's frame.
    pub(super) fn actor_splats(
        &self,
        avatar: AvatarSplats<'_>,
        actor_body: &ActorBody<'_>,
        view: &SceneView,
    ) -> Result<(HostSplats<'_>, View), RenderError> {
        let ActorBody { actor, body } = *actor_body;
        let (slot, pose) = (actor.slot, &actor.pose);
        let mut body_view = body_view(&body.skeleton, pose, &view.camera);
        let mut splats = self.posed(avatar, slot, body, pose, &body_view)?;
        match actor.light {
            Light::Own => (),
            Light::Neutral => splats.light = vec![0.0; 3 * LIGHTS].into(),
            Light::Of { slot, rotation } => {
                let other = avatar.splats.get(slot);
                let light = other.ok_or(RenderError::NoSuchSlot(slot))?.light.val();
                splats.light = read(light.detach())?.into();
                body_view.world = product(&rotation, &body_view.world);
            }
        }
        Ok((splats, body_view))
    }
}

fn product(a: &[[f32; 3]; 3], b: &[[f32; 3]; 3]) -> [[f32; 3]; 3] {
    a.map(|row| std::array::from_fn(|c| (0..3).map(|k| row[k] * b[k][c]).sum()))
}
