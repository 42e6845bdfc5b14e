//! An actor of a scene, ready to be looked at at any time.

use super::clock::Clock;
use super::place::Place;
use crate::jobs::{
    JobFailure,
    render::{
        cast::{Cast, IN_SCENE},
        clip,
        level::UP,
        motion,
        views::capture_camera,
    },
};
use yoto_avatar::render::{Actor, Light};
use yoto_capture::{
    camera::{Camera, Pose},
    skeleton::{Skeleton, readings::interpolate, transform::Vec3},
};
use yoto_proto::v1::{self, CaptureMotion, MotionTransfer, actor::Motion};

/// An actor with their motion in the scene.
pub(super) struct Player {
    slot: usize,
    light: Light,
    body: Skeleton,
    poses: Vec<Pose>,
    place: Place,
    /// The cameras that filmed the poses, in the scene; none for a motion without any.
    cameras: Vec<Camera>,
    pub(super) clock: Clock,
}

/// A motion on the actor's body, in its own world.
struct Moves {
    poses: Vec<Pose>,
    seconds: Vec<f64>,
    up: Vec3,
    cameras: Vec<Camera>,
}

impl Player {
    /// The `actor` at `field` of the request.
    pub(super) fn new(actor: &v1::Actor, field: &str, cast: &Cast<'_>) -> Result<Self, JobFailure> {
        let slot = cast.slot(&actor.subject)?;
        let body = cast.body(&actor.subject)?.clone();
        let moves = moves(actor, field, cast, &body)?;
        let at = [0, 1].map(|axis| actor.at.get(axis).copied().unwrap_or_default());
        let place = Place::new(&body, &moves.poses, moves.up, at, actor.heading);
        let wanted = format!("{field}.light");
        let light = match cast.wanted(actor.light.as_ref(), &wanted, &IN_SCENE)? {
            Some(light) => light,
            None if cast.renderer.has_light() => cast.of(&actor.subject, &IN_SCENE)?,
            None => Light::Own,
        };
        Ok(Self {
            slot,
            light,
            poses: moves.poses.iter().map(|it| place.put(&body, it)).collect(),
            cameras: moves
                .cameras
                .iter()
                .map(|it| place.put_camera(it))
                .collect(),
            clock: Clock {
                seconds: moves.seconds,
                start: actor.start,
                speed: if actor.speed == 0.0 { 1.0 } else { actor.speed },
                repeat: actor.repeat,
            },
            body,
            place,
        })
    }

    /// Frames per second of the motion, unless it is a single pose.
    pub(super) fn fps(&self) -> Option<f64> {
        let interval = self.clock.interval();
        (interval > 0.0).then(|| 1.0 / interval)
    }

    /// The actor at `seconds` of the scene.
    pub(super) fn actor(&self, seconds: f64) -> Actor {
        Actor {
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

    /// `camera`, which is in the world of the motion, at the same place relative to the actor.
    pub(super) fn placed(&self, camera: &Camera) -> Camera {
        self.place.put_camera(camera)
    }

    /// The camera that filmed the pose nearest to `seconds` of the scene.
    pub(super) fn camera(&self, seconds: f64) -> Option<&Camera> {
        let moment = self.clock.at(seconds);
        let nearest = moment.pose + usize::from(moment.share > 0.5);
        self.cameras.get(nearest)
    }
}

fn moves(
    actor: &v1::Actor,
    field: &str,
    cast: &Cast<'_>,
    body: &Skeleton,
) -> Result<Moves, JobFailure> {
    match &actor.motion {
        Some(Motion::Capture(motion)) => captured(actor, motion, field, cast, body),
        Some(Motion::Clip(clip)) => {
            let poses = clip::poses(clip, body, &format!("{field}.clip"), clip.fps)?;
            Ok(Moves {
                seconds: (0..poses.len()).map(|it| it as f64 / clip.fps).collect(),
                poses,
                up: UP,
                cameras: Vec::new(),
            })
        }
        None => Err(JobFailure::invalid("render", field, "has no motion")),
    }
}

/// The motion of a capture.
fn captured(
    actor: &v1::Actor,
    motion: &CaptureMotion,
    field: &str,
    cast: &Cast<'_>,
    body: &Skeleton,
) -> Result<Moves, JobFailure> {
    let subject = match motion.driver.is_empty() {
        true => &actor.subject,
        false => &motion.driver,
    };
    let track = &*cast.track(subject)?;
    let transfer = MotionTransfer {
        first_frame: motion.first_frame,
        frame_count: motion.frame_count,
        frame_step: motion.frame_step,
        end_frame: motion.end_frame,
        ..MotionTransfer::default()
    };
    let places = motion::places(&transfer, track, &format!("{field}.capture"))?;
    let driver = Skeleton::from_track(&track.skeleton)
        .map_err(|error| JobFailure::failed("INTERNAL", "the driver's skeleton", &error))?;
    let frames = places.iter().map(|place| &track.frames[*place]);
    let cameras = frames.clone().map(|frame| capture_camera(track, frame));
    let cameras = cameras.collect::<Result<Vec<_>, _>>()?;
    let up = cameras.first().map_or(UP, Camera::world_up);
    let seconds = motion::seconds(&places, track);
    Ok(Moves {
        poses: motion::poses(&driver, body, track, &places, up)?,
        seconds,
        up,
        cameras,
    })
}
