//! An actor of a scene with their motion.

use super::clock::Clock;
use super::placement::Placement;
use crate::bodies::ModelBodies;
use crate::captures::Captures;
use crate::error::PlanError;
use crate::level::UP;
use crate::plan::{Actor, Light};
use crate::track::{capture_camera, skeleton};
use crate::{clip, light, motion};
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::readings::interpolate;
use yoto_capture::skeleton::transform::Vec3;
use yoto_proto::pose_track::PoseTrack;
use yoto_proto::v1::actor::Motion;
use yoto_proto::v1::{self, CaptureMotion, MotionTransfer};

/// An actor with their motion in the scene.
pub(super) struct AnimatedActor {
    /// Index of the model that draws them.
    model: usize,
    slot: usize,
    light: Light,
    body: Skeleton,
    poses: Vec<Pose>,
    placement: Placement,
    /// The cameras that filmed the poses, in the scene; none for a motion without any.
    cameras: Vec<Camera>,
    pub(super) clock: Clock,
}

/// A motion on the actor's body, in its own world.
struct BodyMotion {
    poses: Vec<Pose>,
    /// Of each pose since the first one.
    seconds: Vec<f64>,
    up: Vec3,
    cameras: Vec<Camera>,
}

/// The subject whose capture has the `motion` of the `actor`: their own, unless it names another.
pub(crate) fn driver<'a>(actor: &'a v1::Actor, motion: &'a CaptureMotion) -> &'a str {
    match motion.driver.is_empty() {
        true => &actor.subject,
        false => &motion.driver,
    }
}

impl AnimatedActor {
    /// The `actor` at `field` of the request. The `model` with the `index` draws them.
    pub(super) fn new(
        actor: &v1::Actor,
        field: &str,
        index: usize,
        model: &ModelBodies,
        captures: &Captures,
    ) -> Result<Self, PlanError> {
        let slot = model.slot(&actor.subject)?;
        let body = model.skeleton(&actor.subject)?.clone();
        let motion = BodyMotion::new(actor, field, &model.name, captures, &body)?;
        let at = [0, 1].map(|axis| actor.at.get(axis).copied().unwrap_or_default());
        let placement = Placement::new(&body, &motion.poses, motion.up, at, actor.heading);
        let poses = motion.poses.iter();
        let cameras = motion.cameras.iter();
        Ok(Self {
            model: index,
            slot,
            light: light::on_actor(actor, field, model, captures)?,
            poses: poses.map(|pose| placement.pose(&body, pose)).collect(),
            cameras: cameras.map(|camera| placement.camera(camera)).collect(),
            clock: Clock {
                seconds: motion.seconds,
                start: actor.start,
                speed: if actor.speed == 0.0 { 1.0 } else { actor.speed },
                repeat: actor.repeat,
            },
            body,
            placement,
        })
    }

    /// Frames per second of the motion, unless it is a single pose.
    pub(super) fn fps(&self) -> Option<f64> {
        let interval = self.clock.interval();
        (interval > 0.0).then(|| 1.0 / interval)
    }

    /// The actor at `seconds` of the scene.
    pub(super) fn at(&self, seconds: f64) -> Actor {
        Actor {
            model: self.model,
            slot: self.slot,
            pose: self.pose(seconds),
            light: self.light,
        }
    }

    fn pose(&self, seconds: f64) -> Pose {
        let moment = self.clock.at(seconds);
        let here = &self.poses[moment.pose];
        match self.poses.get(moment.pose + 1) {
            // The poses of a capture stay as they are.
            Some(next) if moment.share > 0.0 => interpolate(here, next, moment.share),
            _ => here.clone(),
        }
    }

    /// Positions of the joints at `seconds` of the scene, metres.
    pub(super) fn joints(&self, seconds: f64) -> Vec<Vec3> {
        self.body.posed_joints(&self.pose(seconds))
    }

    /// Height of the body at rest, metres.
    pub(super) fn height(&self) -> f64 {
        let heights = || self.body.rest.iter().map(|joint| joint[1]);
        heights().fold(f64::NEG_INFINITY, f64::max) - heights().fold(f64::INFINITY, f64::min)
    }

    /// `camera`, which is in the world of the motion, in the scene.
    pub(super) fn placed(&self, camera: &Camera) -> Camera {
        self.placement.camera(camera)
    }

    /// The camera that filmed the pose nearest to `seconds` of the scene.
    pub(super) fn camera(&self, seconds: f64) -> Option<&Camera> {
        let moment = self.clock.at(seconds);
        let nearest = moment.pose + usize::from(moment.share > 0.5);
        self.cameras.get(nearest)
    }
}

impl BodyMotion {
    /// The motion of the `actor` on their `body`.
    fn new(
        actor: &v1::Actor,
        field: &str,
        model: &str,
        captures: &Captures,
        body: &Skeleton,
    ) -> Result<Self, PlanError> {
        match &actor.motion {
            Some(Motion::Capture(motion)) => {
                let track = captures.track(model, driver(actor, motion))?;
                Self::captured(motion, track, field, body)
            }
            Some(Motion::Clip(clip)) => {
                let poses = clip::poses(clip, body, &format!("{field}.clip"), clip.fps)?;
                let frames = 0..poses.len();
                Ok(Self {
                    seconds: frames.map(|frame| frame as f64 / clip.fps).collect(),
                    poses,
                    up: UP,
                    cameras: Vec::new(),
                })
            }
            None => Err(PlanError::invalid(field, "has no motion")),
        }
    }

    /// The `motion` of a driver's `track`.
    fn captured(
        motion: &CaptureMotion,
        track: &PoseTrack,
        field: &str,
        body: &Skeleton,
    ) -> Result<Self, PlanError> {
        let transfer = MotionTransfer {
            first_frame: motion.first_frame,
            frame_count: motion.frame_count,
            frame_step: motion.frame_step,
            end_frame: motion.end_frame,
            ..MotionTransfer::default()
        };
        let positions = motion::positions(&transfer, track, &format!("{field}.capture"))?;
        let driver = skeleton(track, "the driver")?;
        let frames = positions.iter().map(|position| &track.frames[*position]);
        let cameras = frames.map(|frame| capture_camera(track, frame));
        let cameras = cameras.collect::<Result<Vec<_>, _>>()?;
        let up = cameras.first().map_or(UP, Camera::world_up);
        Ok(Self {
            poses: motion::poses(&driver, body, track, &positions, up)?,
            seconds: motion::seconds(&positions, track),
            up,
            cameras,
        })
    }
}
