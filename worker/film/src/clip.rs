//! An imported motion on the body of the subject.
//!
//! The motion has neither the capture's world nor its camera: it is moved so that its first frame has the
//! subject's place and facing in a frame of their own capture, upright, that both tread on one floor, and it is
//! rendered from that frame's camera.

use crate::error::PlanError;
use crate::follow::followed;
use crate::level::{FORWARD, UP, upright};
use crate::motion::sized;
use crate::shot::Shot;
use crate::track::{capture_camera, find_position, pose};
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::transform::{
    Vec3, add, apply, compose_axis_angle, cross, dot, length, normalised, rigid, rodrigues, scale,
    sub,
};
use yoto_capture::skeleton::{Skeleton, transfer};
use yoto_proto::pose_track::{self, PoseTrack};
use yoto_proto::v1::MotionClip;

/// The shots of all poses of `clip`, on `body`, in the world of its capture's `track`. A clip without a speed of
/// its own has `fps` frames per second.
pub(crate) fn shots(
    clip: &MotionClip,
    track: &PoseTrack,
    body: &Skeleton,
    fps: f64,
) -> Result<Vec<Shot>, PlanError> {
    let position = match clip.camera_frame {
        Some(index) => find_position(track, index, "clip.camera_frame")?,
        None => 0,
    };
    let frame = &track.frames[position];
    let camera = sized(&capture_camera(track, frame)?, clip.size);
    let poses = poses(clip, body, "clip", fps)?;
    let Some(first) = poses.first() else {
        return Err(PlanError::invalid("clip.poses", "the list is empty"));
    };
    let to_capture = ToCapture::new(&poses, first, &pose(frame)?, body, camera.world_up());
    let start = to_capture.pose(first);
    let shots = poses.iter().map(|pose| {
        let pose = to_capture.pose(pose);
        let camera = match clip.follow {
            true => followed(&camera, &start, &pose),
            false => camera.clone(),
        };
        Shot { pose, camera }
    });
    Ok(shots.collect())
}

/// The poses of `clip`, which the request has at `field`, on `body`, in the clip's world. A clip without a speed
/// of its own has `fps` frames per second.
pub(crate) fn poses(
    clip: &MotionClip,
    body: &Skeleton,
    field: &str,
    fps: f64,
) -> Result<Vec<Pose>, PlanError> {
    let driver = driver(clip, body, field)?;
    let at = |index: usize, name: &str, message: String| {
        PlanError::invalid(&format!("{field}.poses[{index}].{name}"), message)
    };
    let poses = clip.poses.iter().enumerate().map(|(index, pose)| {
        Pose::from_proto(pose).map_err(|error| at(index, &error.field, error.message))
    });
    let poses = poses.collect::<Result<Vec<_>, _>>()?;
    let fps = if clip.fps > 0.0 { clip.fps } else { fps };
    let seconds: Vec<f64> = (0..poses.len()).map(|index| index as f64 / fps).collect();
    transfer(&driver, body, &poses, &seconds, UP)
        .map_err(|(index, error)| at(index, "rotations", error.to_string()))
}

/// The skeleton of the motion. Without rest joints it has the size of `body`.
fn driver(clip: &MotionClip, body: &Skeleton, field: &str) -> Result<Skeleton, PlanError> {
    let field = format!("{field}.skeleton");
    let invalid = |message: String| PlanError::invalid(&field, message);
    let message = clip
        .skeleton
        .clone()
        .ok_or_else(|| invalid("is missing".into()))?;
    let skeleton = pose_track::Skeleton::from_proto(message)
        .map_err(|violation| invalid(pose_track::describe(&violation)))?;
    Skeleton::of_motion(&skeleton, body).map_err(|error| invalid(error.to_string()))
}

/// The rigid motion from a clip's world to a capture's.
struct ToCapture {
    /// Axis-angle, from the clip's world to the capture's.
    rotation: Vec3,
    /// Position of the root in the clip's first pose, relative to rest.
    from: Vec3,
    /// The same position in the capture's world.
    to: Vec3,
}

impl ToCapture {
    /// Takes `first`, one of the `poses` of a clip, to the place and facing of `captured`, a pose in a world with `up`
    /// up, so that `body` treads on the same floor in both.
    fn new(poses: &[Pose], first: &Pose, captured: &Pose, body: &Skeleton, up: Vec3) -> Self {
        let upright = upright(up);
        let faces = |pose: &Pose, before: Vec3| {
            let root = pose.rotations_f64().first().copied().unwrap_or_default();
            let whole = compose_axis_angle(before, root);
            let forward = apply(&rigid(rodrigues(whole), [0.0; 3]), FORWARD);
            sub(forward, scale(up, dot(forward, up)))
        };
        let (here, wanted) = (faces(first, upright), faces(captured, [0.0; 3]));
        // A body on its back has no horizontal facing: the motion then keeps its own direction.
        let rotation = if length(here) < 1e-3 || length(wanted) < 1e-3 {
            upright
        } else {
            let (here, wanted) = (normalised(here), normalised(wanted));
            let angle = dot(cross(here, wanted), up).atan2(dot(here, wanted));
            compose_axis_angle(scale(up, angle), upright)
        };
        let mut found = Self {
            rotation,
            from: first.translation.map(f64::from),
            to: captured.translation.map(f64::from),
        };
        // Who begins to crouch, sit or jump does not stand on the floor with their root at its height in the capture.
        let moved: Vec<Pose> = poses.iter().map(|pose| found.pose(pose)).collect();
        let rise = body.floor(std::slice::from_ref(captured), up) - body.floor(&moved, up);
        found.to = add(found.to, scale(up, rise));
        found
    }

    /// `pose` of the clip in the capture's world.
    fn pose(&self, pose: &Pose) -> Pose {
        let mut moved = pose.clone();
        if let Some(root) = moved.rotations.first_mut() {
            *root = compose_axis_angle(self.rotation, root.map(f64::from)).map(|v| v as f32);
        }
        // Rest positions cancel: in both worlds, the root is at the same rest position plus these.
        let step = sub(pose.translation.map(f64::from), self.from);
        let step = apply(&rigid(rodrigues(self.rotation), [0.0; 3]), step);
        moved.translation = add(self.to, step).map(|v| v as f32);
        moved
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::track;
    use yoto_capture::skeleton::transform::position;
    use yoto_proto::v1::{BodyPose, Skeleton as Message};

    fn clip(rest_joints: &[f64]) -> MotionClip {
        let pose = |step: f32| BodyPose {
            // Facing +x, walking that way; the tip bends.
            rotations: vec![0.0, 1.570_796_4, 0.0, 0.3, 0.0, 0.0],
            translation: vec![10.0 + step, 5.0, 0.0],
        };
        MotionClip {
            skeleton: Some(Message {
                names: vec!["root".into(), "tip".into()],
                parents: vec![-1, 0],
                rest_joints: rest_joints.to_vec(),
            }),
            poses: vec![pose(0.0), pose(0.5)],
            size: 32,
            camera_frame: Some(5),
            follow: false,
            fps: 0.0,
        }
    }

    fn body() -> Skeleton {
        Skeleton::from_track(&track().skeleton).expect("a skeleton")
    }

    #[test]
    fn the_first_frame_stands_where_the_capture_does_and_walks_ahead() {
        let track = track();
        let views = shots(&clip(&[]), &track, &body(), 30.0).expect("views");
        let there = pose(&track.frames[0]).expect("a pose");
        assert_eq!(views[0].pose.translation, there.translation);
        // The capture's frame 5 faces +z: so does the clip, and walks there.
        for axis in 0..3 {
            assert!(views[0].pose.rotations[0][axis].abs() < 1e-6);
            let walked = views[1].pose.translation[axis] - views[0].pose.translation[axis];
            let wanted = [0.0, 0.0, 0.5][axis];
            assert!((walked - wanted).abs() < 1e-6, "{walked}");
        }
        assert_eq!(views[1].pose.rotations[1], [0.3, 0.0, 0.0]);
        assert_eq!((views[0].camera.width, views[0].camera.height), (32, 24));
        assert_eq!(views[0].camera.e, track.frames[0].e);
    }

    #[test]
    fn strides_fit_the_legs() {
        // Twice as tall as the body (0.8 m from root to tip), in centimetres.
        let tall = clip(&[0.0, 200.0, 0.0, 0.0, 40.0, 0.0]);
        let views = shots(&tall, &track(), &body(), 30.0).expect("views");
        let walked = views[1].pose.translation[2] - views[0].pose.translation[2];
        assert!((walked - 0.5 * 0.8 / 160.0).abs() < 1e-6, "{walked}");
    }

    #[test]
    fn a_world_upside_down_rotates_the_clip() {
        for up in [[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]] {
            let rotation = rigid(rodrigues(upright(up)), [0.0; 3]);
            assert!(length(sub(apply(&rotation, UP), up)) < 1e-9, "{up:?}");
            assert_eq!(position(&rotation), [0.0; 3]);
        }
        let standing = Pose {
            rotations: vec![[0.0; 3]],
            translation: [0.0, 1.0, 0.0],
        };
        // A standing person in a world with y down is rotated by half a turn about x.
        let there = Pose {
            rotations: vec![[std::f32::consts::PI, 0.0, 0.0]],
            translation: [0.0, -1.0, 3.0],
        };
        let alone = std::slice::from_ref(&standing);
        let to_capture = ToCapture::new(alone, &standing, &there, &body(), [0.0, -1.0, 0.0]);
        let put = to_capture.pose(&standing);
        assert_eq!(put.translation, there.translation);
        let facing = rigid(rodrigues(put.rotations[0].map(f64::from)), [0.0; 3]);
        assert!(length(sub(apply(&facing, UP), [0.0, -1.0, 0.0])) < 1e-6);
        assert!(length(sub(apply(&facing, FORWARD), [0.0, 0.0, -1.0])) < 1e-6);
    }

    #[test]
    fn a_motion_that_begins_in_a_crouch_stands_up_on_the_capture_s_floor() {
        let mut rising = clip(&[]);
        // The root is 0.4 m lower in the first frame, and leans so that the tip, the foot here, stays on the floor.
        rising.poses[0].translation[1] -= 0.4;
        rising.poses[0].rotations[..3].copy_from_slice(&[std::f32::consts::FRAC_PI_3, 0.0, 0.0]);
        let track = track();
        let views = shots(&rising, &track, &body(), 30.0).expect("views");
        let tip = |pose: &Pose| body().posed_joints(pose)[1][1];
        let floor = tip(&pose(&track.frames[0]).expect("a pose"));
        for view in &views {
            assert!(
                (tip(&view.pose) - floor).abs() < 1e-5,
                "{}",
                tip(&view.pose)
            );
        }
    }

    #[test]
    fn what_does_not_fit_is_named() {
        type Break = fn(&mut MotionClip);
        let cases: [(Break, &str); 5] = [
            (|clip| clip.skeleton = None, "clip.skeleton"),
            (|clip| clip.poses.clear(), "clip.poses"),
            (
                |clip| clip.poses[1].translation[0] = f32::NAN,
                "clip.poses[1].translation[0]",
            ),
            (
                |clip| clip.poses[1].rotations.truncate(3),
                "clip.poses[1].rotations",
            ),
            (|clip| clip.camera_frame = Some(99), "clip.camera_frame"),
        ];
        for (break_it, field) in cases {
            let mut broken = clip(&[]);
            break_it(&mut broken);
            let Err(PlanError::Invalid(violations)) = shots(&broken, &track(), &body(), 30.0)
            else {
                panic!("{field} is refused");
            };
            assert_eq!(violations[0].field, field);
        }
    }
}
