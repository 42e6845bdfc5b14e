//! Skeletons with SMPL's joints beside an average adult's.

use super::smpl::{JOINTS, all_joints};
use super::transform::{length, sub};
use super::{Skeleton, Vec3};

/// Sum of the lengths of SMPL's 23 bones of the bodies that the shared body is learned from, metres.
const BONES: f64 = 4.581;

/// The skeleton with these rest joints, which are as many of SMPL's, of fingers and of the face.
pub(super) fn extended(rest: Vec<Vec3>) -> Skeleton {
    let joints = || all_joints().take(rest.len());
    Skeleton {
        names: joints().map(|(name, _)| name.to_owned()).collect(),
        parents: joints().map(|(_, parent)| parent).collect(),
        rest,
    }
}

/// The size of a person with SMPL's joints as a multiple of the mean of the bodies that the shared body is learned from.
pub(super) fn size(skeleton: &Skeleton) -> f64 {
    let bones = (1..JOINTS.len()).filter_map(|joint| {
        let above = skeleton.parents[joint]?;
        Some(length(sub(skeleton.rest[joint], skeleton.rest[above])))
    });
    bones.sum::<f64>() / BONES
}
