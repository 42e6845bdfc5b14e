//! Light on the people of a render.

use crate::bodies::ModelBodies;
use crate::captures::Captures;
use crate::error::PlanError;
use crate::level::levelled;
use crate::plan::Light;
use crate::track::{capture_camera, pose, skeleton};
use yoto_capture::skeleton::transform::{Mat3, dot, rodrigues, scale, sub};
use yoto_proto::pose_track::PoseTrack;
use yoto_proto::v1::light::Of;
use yoto_proto::v1::{self, Actor, RenderSpec};

/// The rotation from the world of a scene to itself.
const IN_SCENE: Mat3 = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Source of the light on a person, in a model that has light.
#[derive(Clone, Copy, Debug)]
pub(crate) enum LightSource<'a> {
    /// The person's capture, in whose world they stand.
    Own,
    /// Nowhere: colours alone.
    Neutral,
    /// The capture of a subject, in another world.
    Capture(&'a str),
}

/// The source of the light in a render of one person, whose pictures are in the world of the capture of the
/// subject `world`. Without a request, people keep the light of their own capture.
pub(crate) fn source_for_one_person<'a>(spec: &'a RenderSpec, world: &str) -> LightSource<'a> {
    match requested(spec.light.as_ref()) {
        Some(Of::Neutral(_)) => LightSource::Neutral,
        Some(Of::Subject(subject)) => LightSource::Capture(subject),
        None if spec.light.is_none() && world != spec.subject => {
            LightSource::Capture(&spec.subject)
        }
        None => LightSource::Own,
    }
}

/// The source of the light on an actor of a scene.
pub(crate) fn source_for_actor(actor: &Actor) -> LightSource<'_> {
    match requested(actor.light.as_ref()) {
        Some(Of::Neutral(_)) => LightSource::Neutral,
        Some(Of::Subject(subject)) => LightSource::Capture(subject),
        None => LightSource::Capture(&actor.subject),
    }
}

/// The light in a render of one person, as [`source_for_one_person`].
pub(crate) fn on_one_person(
    spec: &RenderSpec,
    world: &str,
    model: &ModelBodies,
    captures: &Captures,
) -> Result<Light, PlanError> {
    check(spec.light.as_ref(), "light", model)?;
    match source_for_one_person(spec, world) {
        LightSource::Neutral => Ok(Light::Neutral),
        LightSource::Capture(subject) if model.has_light => {
            let world = to_scene(captures.track(&model.name, world)?)?;
            of_capture(subject, &world, model, captures)
        }
        LightSource::Own | LightSource::Capture(_) => Ok(Light::Own),
    }
}

/// The light on the `actor` at `field` of the request.
pub(crate) fn on_actor(
    actor: &Actor,
    field: &str,
    model: &ModelBodies,
    captures: &Captures,
) -> Result<Light, PlanError> {
    check(actor.light.as_ref(), &format!("{field}.light"), model)?;
    match source_for_actor(actor) {
        LightSource::Neutral => Ok(Light::Neutral),
        LightSource::Capture(subject) if model.has_light => {
            of_capture(subject, &IN_SCENE, model, captures)
        }
        LightSource::Own | LightSource::Capture(_) => Ok(Light::Own),
    }
}

fn requested(light: Option<&v1::Light>) -> Option<&Of> {
    light.and_then(|light| light.of.as_ref())
}

/// Only some models can be lit as requested.
fn check(light: Option<&v1::Light>, field: &str, model: &ModelBodies) -> Result<(), PlanError> {
    if requested(light).is_none() || model.has_light {
        return Ok(());
    }
    let message = "only models of splats (tier splat) have a light apart from their colours";
    Err(PlanError::invalid(field, message))
}

/// The light of the capture of `subject` in a world from which `world` leads to that of a scene.
fn of_capture(
    subject: &str,
    world: &Mat3,
    model: &ModelBodies,
    captures: &Captures,
) -> Result<Light, PlanError> {
    let slot = model.slot(subject)?;
    let own = to_scene(captures.track(&model.name, subject)?)?;
    // The inverse of a rotation is its transpose: rotation = ownᵀ world.
    let element = |r: usize, c: usize| (0..3).map(|k| own[k][r] * world[k][c]).sum::<f64>() as f32;
    Ok(Light::Of {
        slot,
        rotation: std::array::from_fn(|r| std::array::from_fn(|c| element(r, c))),
    })
}

/// The rotation from the world of a capture to that of a scene: up is y, and the horizontal direction from the
/// person to the camera of the first frame is z.
fn to_scene(track: &PoseTrack) -> Result<Mat3, PlanError> {
    let Some(frame) = track.frames.first() else {
        return Ok(IN_SCENE);
    };
    let camera = capture_camera(track, frame)?;
    let joints = skeleton(track, "the capture")?.posed_joints(&pose(frame)?);
    let root = joints.first().copied().unwrap_or_default();
    let towards = sub(camera.centre(), root);
    let up = camera.world_up();
    let level = sub(towards, scale(up, dot(towards, up)));
    Ok(rodrigues(levelled(up, level)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::level::UP;
    use crate::testing::track;
    use yoto_capture::skeleton::transform::{length, rigid, rotate};

    #[test]
    fn the_camera_of_the_first_frame_is_ahead() {
        let track = track();
        let rotation = rigid(to_scene(&track).expect("a rotation"), [0.0; 3]);
        let camera = capture_camera(&track, &track.frames[0]).expect("a camera");
        let [x, y, z] = rotate(&rotation, sub(camera.centre(), [0.2, 1.0, 0.3]));
        assert!(x.abs() < 1e-6 && z > 1.0, "{x} {y} {z}");
        assert!(length(sub(rotate(&rotation, UP), UP)) < 1e-9);
    }
}
