//! Hands with fingers: the direction of each finger's joint, and how the hand lies.
//!
//! Rigs differ in how their hands are at rest: the palm faces the floor or the front, fingers are bent, thumbs lie beside or below the
//! palm. Bones that are compared with those of an average hand in the T-pose give each hand the pose that the file shows.

use super::JointHierarchy;
use crate::geometry::{Mat3, Vec3, matmul, matvec, rotation_between, sub, transpose};
use std::sync::LazyLock;
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::fingers::with_fingers;
use yoto_capture::skeleton::smpl::{AVERAGE_REST, FINGERS, JOINTS};
use yoto_capture::skeleton::transform::{cross, dot, normalised, scale};

/// Joints per finger, and of the fingers of a hand.
const PER_FINGER: usize = 3;
const PER_HAND: usize = FINGERS.len() / 2;
/// The first joints of index, middle and little finger, among the joints of a hand.
const INDEX: usize = 0;
const MIDDLE: usize = 3;
const LITTLE: usize = 6;
/// The wrists, in the order of the hands in [`FINGERS`].
const WRISTS: [(&str, usize); 2] = [("l_wrist", 20), ("r_wrist", 21)];

/// An average adult's joints in the T-pose, with fingers.
static T_POSE: LazyLock<Vec<Vec3>> = LazyLock::new(|| {
    let body = Skeleton {
        names: JOINTS.map(|(name, _)| name.to_owned()).to_vec(),
        parents: JOINTS.map(|(_, parent)| parent).to_vec(),
        rest: AVERAGE_REST.to_vec(),
    };
    with_fingers(&body).map_or(body.rest, |it| it.rest)
});

/// Whether SMPL's joint `role` is of a finger.
pub(super) fn is_finger(role: &str) -> bool {
    FINGERS.iter().any(|(name, _)| *name == role)
}

/// D of the wrist or finger joint `role`, whose parent has the D `above`; `None` for other joints, and without the joints that tell.
pub(super) fn rotation(
    hierarchy: &JointHierarchy,
    positions: &[Vec3],
    role: &str,
    above: &Mat3,
) -> Option<Mat3> {
    let place = |role: &str| positions.get(hierarchy.find(role)?).copied();
    if let Some(hand) = WRISTS.iter().position(|(wrist, _)| *wrist == role) {
        let wrist = place(role)?;
        let [index, middle, little] = [INDEX, MIDDLE, LITTLE].map(|at| place(name(hand, at)));
        let rest = [INDEX, MIDDLE, LITTLE].map(|at| offset(hand, at));
        let standing = frame(sub(middle?, wrist), sub(index?, little?))?;
        let t_pose = frame(rest[1], sub(rest[0], rest[2]))?;
        return Some(matmul(&standing, &transpose(&t_pose)));
    }
    let at = FINGERS.iter().position(|(name, _)| *name == role)?;
    let (hand, at) = (at / PER_HAND, at % PER_HAND);
    if at % PER_FINGER + 1 == PER_FINGER {
        return None;
    }
    let along = sub(place(name(hand, at + 1))?, place(role)?);
    let straight = sub(offset(hand, at + 1), offset(hand, at));
    let bent = rotation_between(matvec(above, straight), along)?;
    Some(matmul(&bent, above))
}

/// The name of the joint `at` of the left (0) or right (1) hand.
fn name(hand: usize, at: usize) -> &'static str {
    FINGERS[hand * PER_HAND + at].0
}

/// The offset of the joint `at` from the wrist in the T-pose, metres.
fn offset(hand: usize, at: usize) -> Vec3 {
    let (_, wrist) = WRISTS[hand];
    let finger = T_POSE.get(JOINTS.len() + hand * PER_HAND + at);
    finger.map_or([0.0; 3], |finger| sub(*finger, T_POSE[wrist]))
}

/// The rotation to the directions of a hand: along it, across it towards the index finger, and their normal, as columns. `None` if they
/// are parallel or have no length.
fn frame(along: Vec3, across: Vec3) -> Option<Mat3> {
    let direction = |v: Vec3| (dot(v, v) > f64::EPSILON).then(|| normalised(v));
    let along = direction(along)?;
    let across = direction(sub(across, scale(along, dot(along, across))))?;
    let normal = cross(along, across);
    Some(transpose(&[along, across, normal]))
}

#[cfg(test)]
mod tests {
    use super::super::{GlobalPose, Joint, JointHierarchy};
    use super::*;
    use crate::geometry::about_axis;
    use yoto_capture::camera::Pose;
    use yoto_capture::skeleton::smpl::{WITH_FINGERS, all_joints};
    use yoto_capture::skeleton::transform::{length, position};

    /// The pose of a rig whose axes differ at each joint.
    fn of_rig(skeleton: &Skeleton, pose: &Pose) -> GlobalPose {
        let joints = skeleton.global_transforms(&pose.rotations_f64());
        let axes = |(at, joint): (usize, &[[f64; 4]; 3])| {
            let rotation = joint.map(|[x, y, z, _]| [x, y, z]);
            matmul(&rotation, &about_axis(at % 3, at as f64))
        };
        GlobalPose {
            rotations: joints.iter().enumerate().map(axes).collect(),
            positions: joints.iter().map(position).collect(),
        }
    }

    #[test]
    fn hands_that_are_twisted_and_bent_at_rest_are_read_as_they_are() {
        let joints = || all_joints().take(WITH_FINGERS);
        let skeleton = Skeleton {
            names: joints().map(|(name, _)| name.to_owned()).collect(),
            parents: joints().map(|(_, parent)| parent).collect(),
            rest: T_POSE.clone(),
        };
        let joint = |at: usize| Joint {
            name: skeleton.names[at].clone(),
            role: Some(skeleton.names[at].clone()),
            parent: skeleton.parents[at],
        };
        let hierarchy = JointHierarchy((0..skeleton.joints()).map(joint).collect());
        let at = |name: &str| hierarchy.find(name).expect("a joint");
        let posed = |twist: f32, bend: f32| {
            let mut pose = Pose::rest(skeleton.joints());
            for (side, sign) in [("l", 1.0), ("r", -1.0)] {
                pose.rotations[at(&format!("{side}_wrist"))] = [twist, 0.1, 0.2 * sign];
                for finger in ["index", "middle", "pinky"] {
                    for joint in [1, 2] {
                        let name = format!("{side}_{finger}{joint}");
                        pose.rotations[at(&name)] = [0.0, 0.0, -sign * bend];
                    }
                }
            }
            pose
        };
        let rest = of_rig(&skeleton, &posed(1.2, 0.4));
        let retarget = hierarchy.retarget(&rest);
        let wanted = posed(-0.3, 0.9);
        let found = retarget.local_rotations(&of_rig(&skeleton, &wanted).rotations);
        for (at, (found, wanted)) in found.iter().zip(wanted.rotations_f64()).enumerate() {
            // The last joint of a finger goes on as the one above, so that a bend there would be lost.
            let off = length(sub(*found, wanted));
            assert!(off < 0.1, "{}: {off}", skeleton.names[at]);
        }
    }
}
