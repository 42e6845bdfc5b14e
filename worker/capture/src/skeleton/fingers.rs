//! Where fingers are in the rest pose of a person whose skeleton does not tell.

use super::average::{extended, size};
use super::smpl::{self, FINGERS, JOINTS};
use super::transform::{add, matvec, rotation_between, scale, sub};
use super::{Skeleton, Vec3};

/// Offsets of the left hand's finger joints from the wrist in the T-pose, metres: the means of the bodies that the shared body is learned
/// from. The right hand mirrors them.
pub const AVERAGE: [Vec3; FINGERS.len() / 2] = [
    [0.0797, 0.0136, 0.0409],
    [0.1190, 0.0149, 0.0432],
    [0.1414, 0.0129, 0.0452],
    [0.0808, 0.0179, 0.0190],
    [0.1244, 0.0136, 0.0203],
    [0.1517, 0.0085, 0.0212],
    [0.0804, 0.0091, -0.0248],
    [0.1141, 0.0055, -0.0228],
    [0.1322, 0.0025, -0.0224],
    [0.0815, 0.0152, -0.0038],
    [0.1227, 0.0117, -0.0025],
    [0.1478, 0.0062, -0.0011],
    [0.0240, -0.0203, 0.0297],
    [0.0325, -0.0286, 0.0455],
    [0.0561, -0.0383, 0.0653],
];
/// How far the three joints of index, middle, little and ring finger bend in a hand at rest, radians.
pub const RELAXED: [[f64; 3]; 4] = [
    [0.3, 0.4, 0.25],
    [0.3, 0.4, 0.25],
    [0.4, 0.4, 0.25],
    [0.35, 0.4, 0.25],
];
/// Index of the middle finger's first joint among the fingers' joints: the end of the hand's bone.
const MIDDLE: usize = 3;
/// Wrist and hand of both sides, among SMPL's joints.
const HANDS: [[usize; 2]; 2] = [[20, 22], [21, 23]];

/// `skeleton`, which has SMPL's joints, with an average adult's fingers, as large as its bones are; `None` for other skeletons. The middle
/// finger begins in the direction of the hand's joint.
pub fn with_fingers(skeleton: &Skeleton) -> Option<Skeleton> {
    if !smpl::has_joints(skeleton) || skeleton.joints() != JOINTS.len() {
        return None;
    }
    let mut rest = skeleton.rest.clone();
    let size = size(skeleton);
    for (side, [wrist, hand]) in HANDS.into_iter().enumerate() {
        let mirrored = |[x, y, z]: Vec3| [if side == 0 { x } else { -x }, y, z];
        let along = sub(rest[hand], rest[wrist]);
        let rotation = rotation_between(mirrored(AVERAGE[MIDDLE]), along);
        let from = rest[wrist];
        let own = AVERAGE.map(|offset| {
            let offset = scale(mirrored(offset), size);
            add(from, rotation.map_or(offset, |it| matvec(&it, offset)))
        });
        rest.extend(own);
    }
    Some(extended(rest))
}

/// The rotation of a joint of a finger of a hand at rest, by its index in a skeleton with fingers; `None` for other
/// joints. In the T-pose
/// palms face down and arms point to the sides, so fingers bend about z.
pub fn relaxed(joint: usize) -> Option<[f32; 3]> {
    let index = joint.checked_sub(JOINTS.len())?;
    let half = FINGERS.len() / 2;
    let bend = RELAXED.as_flattened().get(index % half);
    let sign = if index < half { -1.0 } else { 1.0 };
    (index < FINGERS.len()).then(|| [0.0, 0.0, bend.map_or(0.0, |bend| (sign * bend) as f32)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skeleton::smpl::WITH_FINGERS;
    use crate::skeleton::transform::length;

    #[test]
    fn fingers_go_on_where_the_hands_point() {
        let plain = extended(smpl::AVERAGE_REST.to_vec());
        let hands = with_fingers(&plain).expect("SMPL's joints");
        assert_eq!(hands.joints(), WITH_FINGERS);
        assert!(smpl::has_joints(&hands));
        assert_eq!(smpl::joints_of_body(&hands), JOINTS.len());
        for (left, right) in (24..39).zip(39..54) {
            let ([x, y, z], mirrored) = (hands.rest[left], hands.rest[right]);
            assert!(length(sub([-x, y, z], mirrored)) < 1e-9, "{left}");
            assert!(x > plain.rest[20][0], "{left}");
        }
        // The middle finger's first joint lies on the line of the hand's bone.
        let [along, knuckle] = [plain.rest[22], hands.rest[27]].map(|it| sub(it, plain.rest[20]));
        let off = rotation_between(along, knuckle).map(|it| it[0][0]);
        assert!(off.is_none_or(|it| it > 0.999_99), "{off:?}");
        assert!((0.08..0.1).contains(&length(knuckle)));
        // There is no second pair of hands, and none for other trees.
        assert_eq!(with_fingers(&hands), None);
        let mut other = plain;
        other.names[3] = "tail".into();
        assert_eq!(with_fingers(&other), None);
    }
}
