//! Where jaw, eyes and eyelids are in the rest pose of a person whose skeleton does not tell.

use super::average::{extended, size};
use super::fingers::with_fingers;
use super::smpl::{FACE, WITH_FINGERS, has_joints};
use super::transform::{add, matvec, rotation_between, scale, sub};
use super::{Skeleton, Vec3, smpl};

/// Offsets of the face's joints from the head's joint in the T-pose, metres: the means of the bodies that the shared body is learned from.
/// The jaw turns about the line through its two joints, before the ears. An eyelid turns about the middle of its eye.
const AVERAGE: [Vec3; FACE.len()] = [
    [0.0, 0.0253, 0.0151],
    [0.0302, 0.053, 0.0613],
    [-0.0302, 0.053, 0.0613],
    [0.0302, 0.053, 0.0613],
    [-0.0302, 0.053, 0.0613],
];
/// Offset of the head's joint from the neck's in these bodies, metres.
const HEAD: Vec3 = [0.0, 0.0907, 0.0319];
/// Neck and head among SMPL's joints.
const NECK_AND_HEAD: [usize; 2] = [12, 15];

/// `skeleton`, which has SMPL's joints, with an average adult's face, and fingers if it has none; `None` for other skeletons, and for those
/// with a face. The head goes on in the direction of the neck, as the shared body's does.
pub fn with_face(skeleton: &Skeleton) -> Option<Skeleton> {
    let fingered = match skeleton.joints() {
        smpl::WITH_FACE => None,
        WITH_FINGERS => has_joints(skeleton).then(|| skeleton.clone()),
        _ => with_fingers(skeleton),
    }?;
    let mut rest = fingered.rest;
    let size = size(skeleton);
    let [neck, head] = NECK_AND_HEAD.map(|joint| rest[joint]);
    let rotation = rotation_between(HEAD, sub(head, neck));
    rest.extend(AVERAGE.map(|offset| {
        let offset = scale(offset, size);
        add(head, rotation.map_or(offset, |it| matvec(&it, offset)))
    }));
    Some(extended(rest))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skeleton::smpl::{AVERAGE_REST, JOINTS, WITH_FACE, joints_of_body};

    #[test]
    fn a_face_is_before_the_head_and_goes_with_it() {
        let plain = extended(AVERAGE_REST.to_vec());
        let face = with_face(&plain).expect("SMPL's joints");
        assert_eq!(face.joints(), WITH_FACE);
        assert!(has_joints(&face));
        assert_eq!(joints_of_body(&face), JOINTS.len());
        let [head, jaw, left, right] = [15, 54, 55, 56].map(|joint| face.rest[joint]);
        // Eyes look along z, left of the middle and right of it, above the jaw's joint and before it.
        assert!((left[0] + right[0]).abs() < 1e-9 && left[0] > 0.02);
        assert!(left[2] > jaw[2] && left[1] > jaw[1] && jaw[1] > head[1]);
        assert_eq!(face.rest[57..], face.rest[55..57]);
        // Fingers that are there stay.
        let fingered = with_fingers(&plain).expect("SMPL's joints");
        assert_eq!(with_face(&fingered), Some(face.clone()));
        assert_eq!(with_face(&face), None);
    }
}
