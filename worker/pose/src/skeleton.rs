//! The body that is fitted: an average adult's rest joints, with bone lengths that scale in groups, shared by
//! left and right.

pub(crate) use yoto_capture::skeleton::smpl::AVERAGE_REST as REST;

use yoto_capture::skeleton::Vec3;
use yoto_capture::skeleton::transform::{add, length, scale, sub};
use yoto_proto::pose_track;
use yoto_proto::smpl::JOINTS;

/// Joints of the tree.
pub(crate) const COUNT: usize = JOINTS.len();

/// Distance from the ankle to the sole as a share of the shin. With `CROWN`, the part of a height beyond the
/// joints.
const SOLE: f64 = 0.085 / 0.405;
const CROWN: f64 = 0.21 / 0.3;

/// Groups of bones that scale together.
pub(crate) const GROUPS: usize = 12;

/// The group of the bones from the pelvis to the hips.
const HIPS: usize = 0;

/// The group of the bone from a joint's parent to the joint; the root has none.
pub(crate) const GROUP: [Option<usize>; COUNT] = [
    None,
    Some(HIPS),
    Some(HIPS),
    Some(1),
    Some(4),
    Some(4),
    Some(1),
    Some(5),
    Some(5),
    Some(1),
    Some(6),
    Some(6),
    Some(2),
    Some(7),
    Some(7),
    Some(3),
    Some(8),
    Some(8),
    Some(9),
    Some(9),
    Some(10),
    Some(10),
    Some(11),
    Some(11),
];

/// Standard deviation of the logarithm of each group's length relative to the average's.
pub(crate) const GROUP_SPREAD: [f64; GROUPS] = [
    0.03, 0.06, 0.08, 0.08, 0.07, 0.07, 0.08, 0.08, 0.08, 0.07, 0.07, 0.08,
];

/// The parent of a joint; the root's is itself.
pub(crate) fn parent(joint: usize) -> usize {
    JOINTS.get(joint).and_then(|(_, above)| *above).unwrap_or(0)
}

/// A joint's counterpart on the other side; a joint in the middle is its own. A right joint follows its left
/// one.
pub(crate) fn other_side(joint: usize) -> usize {
    match JOINTS.get(joint).map(|(name, _)| name.split_at(2).0) {
        Some("l_") => joint + 1,
        Some("r_") => joint - 1,
        _ => joint,
    }
}

/// Joints from `joint` up to the root, both included.
pub(crate) fn chain(joint: usize) -> impl Iterator<Item = usize> {
    std::iter::successors(Some(joint), |&at| (at != 0).then(|| parent(at)))
}

/// The part of a bone that scales with its group, in T-pose, metres. Hips scale sideways only, since nothing
/// shows the pelvis joint above them.
pub(crate) fn growing(joint: usize) -> Vec3 {
    let [x, y, z] = sub(REST[joint], REST[parent(joint)]);
    match GROUP[joint] {
        Some(HIPS) => [x, 0.0, 0.0],
        Some(_) => [x, y, z],
        None => [0.0; 3],
    }
}

/// Offsets of joints from their parents, metres, with bones `factors` times as long as the average's.
pub(crate) fn offsets(factors: &[f64; GROUPS]) -> [Vec3; COUNT] {
    std::array::from_fn(|joint| match GROUP[joint] {
        Some(group) => {
            let whole = sub(REST[joint], REST[parent(joint)]);
            add(whole, scale(growing(joint), factors[group] - 1.0))
        }
        None => [0.0; 3],
    })
}

/// Standing height of a body with these offsets, metres.
pub(crate) fn height(offsets: &[Vec3; COUNT]) -> f64 {
    let up = |joints: &[usize]| joints.iter().map(|&joint| offsets[joint][1]).sum::<f64>();
    let shin = length(offsets[7]);
    let head = up(&[12, 15]);
    -up(&[1, 4, 7]) + SOLE * shin + up(&[3, 6, 9]) + (1.0 + CROWN) * head
}

/// The skeleton of a track, with the root at the origin.
pub(crate) fn to_track(offsets: &[Vec3; COUNT]) -> pose_track::Skeleton {
    let mut rest_joints = vec![[0.0; 3]; COUNT];
    for joint in 1..COUNT {
        let above = rest_joints[parent(joint)];
        rest_joints[joint] = std::array::from_fn(|i| above[i] + offsets[joint][i]);
    }
    pose_track::Skeleton {
        names: JOINTS.iter().map(|(name, _)| (*name).to_owned()).collect(),
        parents: JOINTS
            .iter()
            .map(|(_, above)| above.map_or(-1, |above| above as i32))
            .collect(),
        rest_joints,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_average_body_is_as_tall_as_told_and_symmetric() {
        let offsets = offsets(&[1.0; GROUPS]);
        assert!(
            (height(&offsets) - 1.78).abs() < 0.02,
            "{}",
            height(&offsets)
        );
        for (left, right) in [
            (1, 2),
            (4, 5),
            (7, 8),
            (10, 11),
            (13, 14),
            (16, 17),
            (22, 23),
        ] {
            let [x, y, z] = offsets[left];
            assert_eq!(offsets[right], [-x, y, z]);
            assert_eq!(GROUP[left], GROUP[right]);
        }
    }

    #[test]
    fn chains_end_at_the_root() {
        assert_eq!(chain(20).collect::<Vec<_>>(), [20, 18, 16, 13, 9, 6, 3, 0]);
        assert_eq!(chain(0).collect::<Vec<_>>(), [0]);
    }
}
