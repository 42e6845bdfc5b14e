//! The people of a request: their bodies, and the light on them.

use super::{level::levelled, models::Loaded, request::Request, views};
use crate::jobs::{JobContext, JobFailure, checkpoint::Downloaded, shard};
use std::cell::RefCell;
use std::collections::HashMap;
use std::sync::Arc;
use yoto_avatar::render::{Light, Renderer};
use yoto_capture::Shard;
use yoto_capture::skeleton::{
    Skeleton,
    transform::{Mat3, dot, rodrigues, scale, sub},
};
use yoto_proto::{
    pose_track::PoseTrack,
    v1::{self, Inputs, light::Of},
};

/// A turn that changes nothing: of light in the world of a scene.
pub(super) const IN_SCENE: Mat3 = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Whom a request can show by one of its models.
pub(super) struct Cast<'a> {
    pub(super) context: &'a JobContext,
    pub(super) request: &'a Request<'a>,
    /// Name of the model.
    pub(super) model: &'a str,
    pub(super) renderer: &'a Renderer,
    pub(super) found: &'a Downloaded,
    pub(super) inputs: &'a Inputs,
    /// Those that were fetched, by subject: the images beside them are not kept.
    tracks: RefCell<HashMap<String, Arc<PoseTrack>>>,
}

impl<'a> Cast<'a> {
    /// Whom `request` can show by the `model`.
    pub(super) fn new(
        context: &'a JobContext,
        request: &'a Request<'a>,
        model: &'a Loaded<'a>,
        inputs: &'a Inputs,
    ) -> Self {
        Self {
            context,
            request,
            model: model.name,
            renderer: &model.renderer,
            found: &model.found,
            inputs,
            tracks: RefCell::default(),
        }
    }

    /// The capture of somebody, with the poses that the model was taught.
    pub(super) fn shard(&self, subject: &str) -> Result<Arc<Shard>, JobFailure> {
        let (context, inputs) = (self.context, self.inputs);
        let (_, shard) = shard::with_refined_poses(context, inputs, self.found, subject)?;
        let track = Arc::new(shard.track.clone());
        self.tracks.borrow_mut().insert(subject.to_owned(), track);
        Ok(shard)
    }

    /// The pose track of that capture.
    pub(super) fn track(&self, subject: &str) -> Result<Arc<PoseTrack>, JobFailure> {
        let known = self.tracks.borrow().get(subject).map(Arc::clone);
        match known {
            Some(track) => Ok(track),
            None => Ok(Arc::new(self.shard(subject)?.track.clone())),
        }
    }

    /// The slot of somebody whom the request shows, or whose light.
    pub(super) fn slot(&self, subject: &str) -> Result<usize, JobFailure> {
        self.request
            .slot_in(self.model, subject)
            .ok_or_else(|| JobFailure::Failed {
                code: "INTERNAL",
                message: format!("the request does not name {subject}"),
            })
    }

    /// The skeleton that the checkpoint knows of somebody.
    pub(super) fn body(&self, subject: &str) -> Result<&Skeleton, JobFailure> {
        let skeleton = self.renderer.skeleton(self.slot(subject)?);
        skeleton.ok_or_else(|| JobFailure::Failed {
            code: "NO_CHECKPOINT",
            message: format!(
                "{} does not know {}: it was trained before they joined the model",
                self.found.checkpoint.name,
                shard::person(self.inputs, subject)
            ),
        })
    }

    /// The light that the request wants on somebody, at `field`, in a world with the given [`bearings`];
    /// `None` if it wants none in particular.
    pub(super) fn wanted(
        &self,
        light: Option<&v1::Light>,
        field: &str,
        world: &Mat3,
    ) -> Result<Option<Light>, JobFailure> {
        let Some(of) = light.and_then(|light| light.of.as_ref()) else {
            return Ok(None);
        };
        if !self.renderer.has_light() {
            let message =
                "only models of splats (tier splat) have a light apart from their colours";
            return Err(JobFailure::invalid("render", field, message));
        }
        match of {
            Of::Neutral(_) => Ok(Some(Light::Neutral)),
            Of::Subject(subject) => self.of(subject, world).map(Some),
        }
    }

    /// The light of the capture of `subject`, in a world with the given [`bearings`].
    pub(super) fn of(&self, subject: &str, world: &Mat3) -> Result<Light, JobFailure> {
        let slot = self.slot(subject)?;
        let own = bearings(&*self.track(subject)?)?;
        // The inverse of a turn is its transpose.
        let turn = |r: usize, c: usize| (0..3).map(|k| own[k][r] * world[k][c]).sum::<f64>() as f32;
        Ok(Light::Of {
            slot,
            turn: std::array::from_fn(|r| std::array::from_fn(|c| turn(r, c))),
        })
    }
}

/// The turn from the world of a capture to that of a scene: up is y, and the camera of the first frame is
/// in the direction z from the person, as far as that is level.
pub(super) fn bearings(track: &PoseTrack) -> Result<Mat3, JobFailure> {
    let Some(frame) = track.frames.first() else {
        return Ok(IN_SCENE);
    };
    let skeleton = Skeleton::from_track(&track.skeleton)
        .map_err(|error| JobFailure::failed("INTERNAL", "the capture's skeleton", &error))?;
    let camera = views::capture_camera(track, frame)?;
    let pose = views::pose(frame)?;
    let body = skeleton.posed_joints(&pose);
    let towards = sub(camera.centre(), body.first().copied().unwrap_or_default());
    let up = camera.world_up();
    let level = sub(towards, scale(up, dot(towards, up)));
    Ok(rodrigues(levelled(up, level)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::render::{level::UP, views::tests::track};
    use yoto_capture::skeleton::transform::{length, rigid, rotate};

    #[test]
    fn the_camera_of_the_first_frame_is_ahead() {
        let track = track();
        let turn = rigid(bearings(&track).expect("bearings"), [0.0; 3]);
        let camera = views::capture_camera(&track, &track.frames[0]).expect("a camera");
        let [x, y, z] = rotate(&turn, sub(camera.centre(), [0.2, 1.0, 0.3]));
        assert!(x.abs() < 1e-6 && z > 1.0, "{x} {y} {z}");
        assert!(length(sub(rotate(&turn, UP), UP)) < 1e-9);
    }
}
