//! Fingers and faces behind SMPL's joints: people with and without them fit together.

use super::Skeleton;
use super::face::with_face;
use super::fingers::with_fingers;
use super::smpl::{WITH_FACE, WITH_FINGERS, has_joints};

/// `skeleton`, which has SMPL's joints, with at least `count` joints: fingers and face that it lacks are an average adult's. `None` for other
/// skeletons, and without such a tree.
pub fn with_count(skeleton: &Skeleton, count: usize) -> Option<Skeleton> {
    if !has_joints(skeleton) {
        return None;
    }
    match count.max(skeleton.joints()) {
        count if count == skeleton.joints() => Some(skeleton.clone()),
        WITH_FINGERS => with_fingers(skeleton),
        WITH_FACE => with_face(skeleton),
        _ => None,
    }
}

/// The bones of `skeleton` for somebody with the joints of `own`, where the two differ by fingers and face alone: these are left out, or
/// are an average adult's.
pub fn with_joints_of(skeleton: &Skeleton, own: &Skeleton) -> Skeleton {
    let (wanted, count) = (own.joints(), skeleton.joints());
    let mut bones = skeleton.clone();
    if !has_joints(skeleton) || !has_joints(own) {
        return bones;
    }
    if wanted < count {
        bones.names.truncate(wanted);
        bones.parents.truncate(wanted);
        bones.rest.truncate(wanted);
        return bones;
    }
    with_count(skeleton, wanted).unwrap_or(bones)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skeleton::average::extended;
    use crate::skeleton::smpl::AVERAGE_REST;

    #[test]
    fn people_get_the_parts_of_others_and_lose_those_that_others_lack() {
        let plain = extended(AVERAGE_REST.to_vec());
        let fingered = with_fingers(&plain).expect("SMPL's joints");
        let face = with_face(&plain).expect("SMPL's joints");
        let all = [&plain, &fingered, &face];
        for from in all {
            for to in all {
                assert_eq!(&with_joints_of(from, to), to);
            }
        }
        assert_eq!(with_count(&face, 24), Some(face));
        assert_eq!(with_count(&plain, 30), None);
        let mut other = plain.clone();
        other.names[3] = "tail".into();
        assert_eq!(with_count(&other, WITH_FACE), None);
        assert_eq!(with_joints_of(&other, &fingered), other);
    }
}
