//! One pose from all around: the camera circles the person at the capture camera's distance and
//! height, and shows the whole body, however little of it the video's frame had.

use crate::error::PlanError;
use crate::shot::Shot;
use crate::track::{capture_camera, find_frame, pose, skeleton};
use std::f64::consts::TAU;
use yoto_capture::camera::Camera;
use yoto_capture::skeleton::transform::{
    Vec3, add, apply, cross, dot, length, rigid, rodrigues, scale, sub,
};
use yoto_proto::pose_track::PoseTrack;
use yoto_proto::v1::Orbit;

/// Space around the outermost joints, as a share of the body's longest extent: a head reaches a
/// tenth of the height above its joint, and hands and hair as far beyond theirs.
const MARGIN: f64 = 0.1;
/// Least distance of the camera from the middle of the body, in radii of the body.
const NEAREST: f64 = 2.0;

/// The shots of `orbit` around the pose of its frame; the first is from the capture camera's side.
pub(crate) fn shots(orbit: &Orbit, track: &PoseTrack) -> Result<Vec<Shot>, PlanError> {
    let frame = find_frame(track, orbit.frame, "orbit.frame")?;
    let skeleton = skeleton(track, "the capture")?;
    let capture = capture_camera(track, frame)?;
    let pose = pose(frame)?;
    let up = capture.world_up();
    let body = Extent::of(&skeleton.posed_joints(&pose), up);
    let shots = (0..orbit.views).map(|view| {
        let angle = TAU * f64::from(view) / f64::from(orbit.views);
        Shot {
            pose: pose.clone(),
            camera: circled(&capture, &body, up, angle, orbit.size),
        }
    });
    Ok(shots.collect())
}

/// The upright cylinder around a body.
struct Extent {
    middle: Vec3,
    /// Half of its height, metres.
    half: f64,
    /// Metres.
    radius: f64,
}

impl Extent {
    /// The cylinder around `joints`, with a margin.
    fn of(joints: &[Vec3], up: Vec3) -> Self {
        let mut low = [f64::INFINITY; 3];
        let mut high = [f64::NEG_INFINITY; 3];
        for joint in joints {
            for axis in 0..3 {
                low[axis] = low[axis].min(joint[axis]);
                high[axis] = high[axis].max(joint[axis]);
            }
        }
        let middle = scale(add(low, high), 0.5);
        let (mut half, mut radius) = (0.0f64, 0.0f64);
        for joint in joints {
            let arm = sub(*joint, middle);
            let height = dot(arm, up);
            half = half.max(height.abs());
            radius = radius.max(length(sub(arm, scale(up, height))));
        }
        let margin = MARGIN * 2.0 * half.max(radius);
        Self {
            middle,
            half: half + margin,
            radius: radius + margin,
        }
    }
}

/// Rotates `capture` by `angle` about the middle of `body`. The picture is `size` square and has the whole body.
fn circled(capture: &Camera, body: &Extent, up: Vec3, angle: f64, size: u32) -> Camera {
    let mut arm = sub(capture.centre(), body.middle);
    if length(sub(arm, scale(up, dot(arm, up)))) < 1e-6 {
        // A camera above or at the person has no horizontal direction: move it aside.
        arm = add(
            arm,
            scale(cross(up, [up[1], up[2], up[0]]), length(arm).max(1.0)),
        );
    }
    let around = body.half.hypot(body.radius);
    let distance = length(arm).max(NEAREST * around);
    let arm = scale(arm, distance / length(arm));
    let rotated = apply(&rigid(rodrigues(scale(up, angle)), [0.0; 3]), arm);
    // The sphere around the body touches the picture's edges.
    let half_view = (around / distance).asin().tan();
    let focal = 0.5 * f64::from(size) / half_view;
    let mut camera = Camera::look_at(
        add(body.middle, rotated),
        body.middle,
        up,
        focal,
        size,
        size,
    );
    camera.k[0][0] = focal * capture.k[0][0] / capture.k[1][1];
    camera
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::track;
    use yoto_capture::skeleton::Skeleton;

    fn joints(track: &PoseTrack) -> Vec<Vec3> {
        let skeleton = Skeleton::from_track(&track.skeleton).expect("a skeleton");
        skeleton.posed_joints(&pose(&track.frames[0]).expect("a pose"))
    }

    fn middle(track: &PoseTrack) -> Vec3 {
        let joints = joints(track);
        scale(add(joints[0], joints[1]), 0.5)
    }

    fn orbit(views: u32, size: u32) -> Orbit {
        Orbit {
            frame: 5,
            views,
            size,
        }
    }

    #[test]
    fn every_camera_keeps_the_body_in_the_middle_at_the_same_distance_and_height() {
        let track = track();
        let middle = middle(&track);
        let capture = capture_camera(&track, &track.frames[0]).expect("a camera");
        let arm = sub(capture.centre(), middle);
        let views = shots(&orbit(8, 100), &track).expect("views");
        assert_eq!(views.len(), 8);
        for view in &views {
            let [x, y] = view.camera.project(middle).expect("in front");
            assert!(
                (x - 50.0).abs() < 1e-9 && (y - 50.0).abs() < 1e-9,
                "{x} {y}"
            );
            let here = sub(view.camera.centre(), middle);
            assert!((length(here) - length(arm)).abs() < 1e-9);
            assert!((here[1] - arm[1]).abs() < 1e-9);
            assert_eq!(view.pose, pose(&track.frames[0]).expect("a pose"));
        }
        let first = views[0].camera.centre();
        assert!(
            length(sub(first, capture.centre())) < 1e-9,
            "begins at the capture camera"
        );
        let opposite = sub(views[4].camera.centre(), middle);
        assert!((opposite[0] + arm[0]).abs() < 1e-9 && (opposite[2] + arm[2]).abs() < 1e-9);
    }

    #[test]
    fn the_whole_body_is_in_the_picture_head_up_however_the_video_was_cropped() {
        let mut track = track();
        // A lens so long that the video shows a part of the body only.
        for row in [0, 1] {
            track.frames[0].k[row][row] = 800.0;
        }
        for size in [32, 128] {
            for view in shots(&orbit(4, size), &track).expect("views") {
                let side = f64::from(size);
                let [head, feet] = [joints(&track)[0], joints(&track)[1]];
                let [head, feet] =
                    [head, feet].map(|joint| view.camera.project(joint).expect("in front"));
                assert!(head[1] < feet[1], "up in the world is up in the picture");
                assert!(
                    head[1] > 0.02 * side && feet[1] < 0.98 * side,
                    "{head:?} {feet:?}"
                );
                assert!(feet[1] - head[1] > 0.5 * side, "{head:?} {feet:?}");
            }
        }
    }

    #[test]
    fn a_camera_inside_the_body_steps_back() {
        let mut track = track();
        let [_, y, z] = middle(&track);
        for (row, offset) in track.frames[0].e.iter_mut().zip([-0.4, y, z]) {
            row[3] = offset;
        }
        for view in shots(&orbit(4, 64), &track).expect("views") {
            for joint in joints(&track) {
                let [x, y] = view.camera.project(joint).expect("in front");
                assert!(
                    (0.0..64.0).contains(&x) && (0.0..64.0).contains(&y),
                    "{x} {y}"
                );
            }
        }
    }

    #[test]
    fn a_camera_in_the_middle_of_the_body_still_gets_a_circle() {
        let mut track = track();
        let [x, y, z] = middle(&track);
        // Upright as before (its rows are x, -y, -z), but standing in the body.
        for (row, offset) in track.frames[0].e.iter_mut().zip([-x, y, z]) {
            row[3] = offset;
        }
        for view in shots(&orbit(6, 64), &track).expect("views") {
            let [x, y] = view.camera.project(middle(&track)).expect("in front");
            assert!(
                (x - 32.0).abs() < 1e-6 && (y - 32.0).abs() < 1e-6,
                "{x} {y}"
            );
        }
    }

    #[test]
    fn a_frame_that_is_not_there_is_named() {
        let asked = Orbit {
            frame: 99,
            ..orbit(1, 64)
        };
        let Err(PlanError::Invalid(violations)) = shots(&asked, &track()) else {
            panic!("refused");
        };
        assert_eq!(violations[0].field, "orbit.frame");
    }
}
