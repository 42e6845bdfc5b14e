//! Other readings of an estimated pose, each of which undoes a common mistake of estimators.
//!
//! In one camera, a body from the front and its mirror image from the back have the same outline, and so
//! do limbs with left and right exchanged. Where an estimator loses track, the frames around tell more
//! than its estimate.

use super::transform::{Vec3, add, compose_axis_angle, scale, sub};
use crate::camera::{Camera, Pose};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;
use std::fmt;

/// How the pose of a frame is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reading {
    /// The numbers as given.
    Given,
    /// Left and right arms exchanged.
    Arms,
    /// Left and right legs exchanged.
    Legs,
    /// Both exchanged.
    Limbs,
    /// Mirrored in depth, with left and right exchanged.
    FrontToBack,
    /// Interpolated between the poses of the nearest frames that fit.
    Between,
}

impl fmt::Display for Reading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Given => "as given",
            Self::Arms => "with exchanged arms",
            Self::Legs => "with exchanged legs",
            Self::Limbs => "with exchanged arms and legs",
            Self::FrontToBack => "turned front to back",
            Self::Between => "between the frames around",
        })
    }
}

/// A symmetric body.
#[derive(Clone, Debug, PartialEq)]
pub struct Sides {
    /// For each joint its counterpart on the other side; a joint on the middle is its own.
    other: Vec<usize>,
    /// Whether a joint belongs to a leg: its nearest ancestor on the middle is the root.
    leg: Vec<bool>,
}

impl Sides {
    /// A body with the joints' counterparts `other` and their `parents`, which come before their children.
    pub fn new(other: Vec<usize>, parents: &[Option<usize>]) -> Self {
        let mut leg = vec![false; other.len()];
        for (joint, parent) in parents.iter().enumerate() {
            let Some(parent) = *parent else { continue };
            let paired = other[joint] != joint;
            let from_root = parent == 0 || (other[parent] != parent && leg[parent]);
            leg[joint] = paired && from_root;
        }
        Self { other, leg }
    }

    /// `pose` with the joints for which `wanted` is true exchanged with their counterparts, except the root.
    fn exchanged(&self, pose: &Pose, wanted: impl Fn(usize) -> bool) -> Pose {
        let rotations = (pose.rotations.iter().enumerate()).map(|(joint, own)| {
            if joint == 0 || !wanted(joint) {
                return *own;
            }
            let [x, y, z] = pose.rotations[self.other[joint]];
            [x, -y, -z]
        });
        Pose {
            rotations: rotations.collect(),
            translation: pose.translation,
        }
    }

    /// Other readings of `pose`, which is seen by `camera`.
    pub fn readings(&self, pose: &Pose, camera: &Camera) -> Vec<(Reading, Pose)> {
        let paired = |joint: usize| self.other[joint] != joint;
        let legs = |joint: usize| paired(joint) && self.leg[joint];
        let arms = |joint: usize| paired(joint) && !self.leg[joint];
        let mut turned = self.exchanged(pose, |_| true);
        if let Some(root) = turned.rotations.first_mut() {
            // A reflection with the normal n is half a turn about n and a point reflection. So is the
            // reflection of the body's sides, and the two point reflections cancel.
            let [x, y, z, _] = camera.e[2];
            let mirrored = compose_axis_angle(scale([x, y, z], PI), root.map(f64::from));
            *root = compose_axis_angle(mirrored, [PI, 0.0, 0.0]).map(|v| v as f32);
        }
        vec![
            (Reading::Arms, self.exchanged(pose, arms)),
            (Reading::Legs, self.exchanged(pose, legs)),
            (Reading::Limbs, self.exchanged(pose, paired)),
            (Reading::FrontToBack, turned),
        ]
    }
}

/// The pose between `a` (`share` 0) and `b` (`share` 1), each joint by its shortest rotation.
pub fn interpolate(a: &Pose, b: &Pose, share: f64) -> Pose {
    let slerp = |(a, b): (&[f32; 3], &[f32; 3])| {
        let (a, b) = (a.map(f64::from), b.map(f64::from));
        let way = compose_axis_angle(scale(a, -1.0), b);
        compose_axis_angle(a, scale(way, share)).map(|v| v as f32)
    };
    let position = |pose: &Pose| -> Vec3 { pose.translation.map(f64::from) };
    let way = scale(sub(position(b), position(a)), share);
    Pose {
        rotations: a.rotations.iter().zip(&b.rotations).map(slerp).collect(),
        translation: add(position(a), way).map(|v| v as f32),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skeleton::Skeleton;
    use crate::skeleton::transform::{dot, length};
    use yoto_proto::correction::other_sides;
    use yoto_synthetic::SyntheticPerson;

    fn body() -> (Skeleton, Sides, Pose, Camera) {
        let (track, _) = SyntheticPerson::cast(1, 7)[0].capture(8, 32);
        let skeleton = Skeleton::from_track(&track.skeleton).expect("a skeleton");
        let other = other_sides(&track.skeleton).expect("symmetric");
        let sides = Sides::new(other, &skeleton.parents);
        let pose = Pose::from_frame(&track.frames[3]).expect("a pose");
        let camera = Camera::from_frame(&track.frames[3], track.image_size).expect("a camera");
        (skeleton, sides, pose, camera)
    }

    #[test]
    fn a_body_turned_front_to_back_has_the_same_outline() {
        let (skeleton, sides, pose, camera) = body();
        let readings = sides.readings(&pose, &camera);
        let (_, turned) = &readings[3];
        let (before, after) = (skeleton.posed_joints(&pose), skeleton.posed_joints(turned));
        let [x, y, z, _] = camera.e[2];
        let forward = [x, y, z];
        let mut moved: f64 = 0.0;
        for (joint, position) in after.iter().enumerate() {
            let source = sub(before[sides.other[joint]], before[0]);
            let mirrored = sub(source, scale(forward, 2.0 * dot(source, forward)));
            assert!(
                length(sub(sub(*position, after[0]), mirrored)) < 1e-4,
                "{joint}"
            );
            moved = moved.max(length(sub(*position, before[joint])));
        }
        assert!(moved > 0.05, "{moved}");
        let again = &sides.readings(turned, &camera)[3].1;
        let back = skeleton.posed_joints(again);
        assert!(
            back.iter()
                .zip(&before)
                .all(|(a, b)| length(sub(*a, *b)) < 1e-4)
        );
    }

    #[test]
    fn arms_and_legs_are_told_apart() {
        let (skeleton, sides, pose, camera) = body();
        let readings = sides.readings(&pose, &camera);
        let same = |a: &Pose, name: &str| {
            let joint = skeleton.names.iter().position(|it| it == name).expect(name);
            a.rotations[joint] == pose.rotations[joint]
        };
        let (arms, legs, both) = (&readings[0].1, &readings[1].1, &readings[2].1);
        assert!(!same(arms, "l_shoulder") && same(arms, "l_hip") && same(arms, "l_knee"));
        assert!(same(legs, "l_shoulder") && !same(legs, "l_hip"));
        assert!(!same(both, "r_shoulder") && !same(both, "r_hip") && same(both, "pelvis"));
        assert!(same(both, "spine1"));
    }

    #[test]
    fn a_lost_pose_lies_between_its_neighbours() {
        let (_, _, a, _) = body();
        let mut b = a.clone();
        b.translation[0] += 1.0;
        b.rotations[4] = compose_axis_angle([0.0, 0.4, 0.0], [0.0; 3]).map(|v| v as f32);
        let mut from = a.clone();
        from.rotations[4] = [0.0; 3];
        let found = interpolate(&from, &b, 0.25);
        assert!((found.rotations[4][1] - 0.1).abs() < 1e-6);
        assert!((found.translation[0] - a.translation[0] - 0.25).abs() < 1e-6);
        assert_eq!(found.rotations[5], a.rotations[5]);
    }
}
