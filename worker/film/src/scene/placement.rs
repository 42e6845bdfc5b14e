//! Where an actor stands: from the world of their motion to that of the scene.

use crate::level::{FORWARD, UP, levelled};
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::transform::{
    Vec3, add, apply, compose_axis_angle, inverse, rigid, rodrigues, scale, sub,
};

/// Height of the lowest joint of a standing person, the ball of a foot, above the ground, metres.
const SOLE: f64 = 0.03;

/// The rigid motion from the world of a motion to that of a scene.
pub(super) struct Placement {
    /// Axis-angle.
    rotation: Vec3,
    translation: Vec3,
}

impl Placement {
    /// The placement with which `poses` of `body`, in a world with `up`, begin at `at` (x, z) on the ground with
    /// the `heading` in degrees, and touch the ground with their lowest joint.
    pub(super) fn new(
        body: &Skeleton,
        poses: &[Pose],
        up: Vec3,
        at: [f64; 2],
        heading: f64,
    ) -> Self {
        let first = poses.first().and_then(|pose| pose.rotations.first());
        let root = first.map_or([0.0; 3], |root| root.map(f64::from));
        let facing = apply(&rigid(rodrigues(root), [0.0; 3]), FORWARD);
        let rotation = compose_axis_angle(scale(UP, heading.to_radians()), levelled(up, facing));
        let mut placement = Self {
            rotation,
            translation: [0.0; 3],
        };
        let lowest = |pose: &Pose| {
            let joints = body.posed_joints(&placement.pose(body, pose));
            joints
                .iter()
                .fold(f64::INFINITY, |low, joint| low.min(joint[1]))
        };
        let ground = poses.iter().map(lowest).fold(f64::INFINITY, f64::min);
        let start = poses.first().map(|pose| {
            let pose = placement.pose(body, pose);
            add(body.root(), pose.translation.map(f64::from))
        });
        if let Some([x, _, z]) = start {
            placement.translation = [at[0] - x, SOLE - ground, at[1] - z];
        }
        placement
    }

    /// `pose` of `body` in the scene.
    pub(super) fn pose(&self, body: &Skeleton, pose: &Pose) -> Pose {
        let mut placed = pose.clone();
        if let Some(root) = placed.rotations.first_mut() {
            *root = compose_axis_angle(self.rotation, root.map(f64::from)).map(|v| v as f32);
        }
        let root = add(body.root(), pose.translation.map(f64::from));
        let moved = apply(&rigid(rodrigues(self.rotation), self.translation), root);
        placed.translation = sub(moved, body.root()).map(|v| v as f32);
        placed
    }

    /// `camera`, which sees the world of the motion, in the scene.
    pub(super) fn camera(&self, camera: &Camera) -> Camera {
        camera.in_frame(&inverse(&rigid(rodrigues(self.rotation), self.translation)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::track;
    use crate::track::{capture_camera, pose};
    use yoto_capture::skeleton::transform::length;

    #[test]
    fn a_motion_begins_where_it_is_placed_and_stands_on_the_ground() {
        let track = track();
        let body = Skeleton::from_track(&track.skeleton).expect("a skeleton");
        let frames = track
            .frames
            .iter()
            .map(|frame| pose(frame).expect("a pose"));
        let poses: Vec<Pose> = frames.collect();
        let placement = Placement::new(&body, &poses, UP, [2.0, -1.0], 90.0);
        let first = placement.pose(&body, &poses[0]);
        let joints = body.posed_joints(&first);
        assert!((joints[0][0] - 2.0).abs() < 1e-6 && (joints[0][2] + 1.0).abs() < 1e-6);
        let all = poses
            .iter()
            .flat_map(|it| body.posed_joints(&placement.pose(&body, it)));
        let lowest = all.fold(f64::INFINITY, |low, joint| low.min(joint[1]));
        assert!((lowest - SOLE).abs() < 1e-6, "{lowest}");
        // The capture moves along z, which its person faces: 90 degrees to their left is x.
        let last = body.posed_joints(&placement.pose(&body, &poses[3]));
        let way = sub(last[0], joints[0]);
        assert!(
            (way[0] - 0.3).abs() < 1e-6 && way[2].abs() < 1e-6,
            "{way:?}"
        );
    }

    #[test]
    fn a_camera_that_moves_along_sees_the_same() {
        let track = track();
        let body = Skeleton::from_track(&track.skeleton).expect("a skeleton");
        let stands = pose(&track.frames[1]).expect("a pose");
        let camera = capture_camera(&track, &track.frames[1]).expect("a camera");
        let up = [0.0, 0.0, 1.0];
        let placement = Placement::new(&body, std::slice::from_ref(&stands), up, [0.5, 3.0], -40.0);
        let moved = placement.camera(&camera);
        let before = body.posed_joints(&stands);
        let after = body.posed_joints(&placement.pose(&body, &stands));
        for (before, after) in before.into_iter().zip(after) {
            let (a, b) = (camera.project(before), moved.project(after));
            let (a, b) = (a.expect("in front"), b.expect("in front"));
            assert!(
                length([a[0] - b[0], a[1] - b[1], 0.0]) < 1e-4,
                "{a:?} {b:?}"
            );
        }
    }
}
