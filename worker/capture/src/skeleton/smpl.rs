//! The joint tree of SMPL, as in the contract, and an average adult's rest joints on it, for people
//! without a known skeleton.

pub use yoto_proto::smpl::{
    FACE, FINGERS, JOINTS, WITH_FACE, WITH_FINGERS, all_joints, is_smpls_tree,
};

use super::{Skeleton, Vec3};

/// Whether the joints of a skeleton are those of SMPL in its order, alone, with fingers, or with fingers and a face.
pub fn has_joints(skeleton: &Skeleton) -> bool {
    let parents = skeleton.parents.iter().copied();
    is_smpls_tree(skeleton.names.iter().map(String::as_str).zip(parents))
}

/// The number of joints of a skeleton without the fingers and the face that follow SMPL's joints; all joints of other skeletons.
pub fn joints_of_body(skeleton: &Skeleton) -> usize {
    match has_joints(skeleton) {
        true => JOINTS.len(),
        false => skeleton.joints(),
    }
}

/// An average adult of [`AVERAGE_HEIGHT`] in T-pose: y up from the floor, facing +z, left hand at +x;
/// metres. The proportions are those of the synthetic people.
pub const AVERAGE_REST: [Vec3; JOINTS.len()] = [
    [0.0, 0.95, 0.0],
    [0.085, 0.9, 0.0],
    [-0.085, 0.9, 0.0],
    [0.0, 1.06, -0.005],
    [0.095, 0.49, 0.005],
    [-0.095, 0.49, 0.005],
    [0.0, 1.18, -0.005],
    [0.1, 0.085, -0.025],
    [-0.1, 0.085, -0.025],
    [0.0, 1.27, -0.005],
    [0.105, 0.03, 0.1],
    [-0.105, 0.03, 0.1],
    [0.0, 1.47, -0.01],
    [0.075, 1.42, -0.01],
    [-0.075, 1.42, -0.01],
    [0.0, 1.57, 0.01],
    [0.18, 1.43, -0.01],
    [-0.18, 1.43, -0.01],
    [0.45, 1.43, -0.015],
    [-0.45, 1.43, -0.015],
    [0.7, 1.43, -0.01],
    [-0.7, 1.43, -0.01],
    [0.78, 1.43, -0.005],
    [-0.78, 1.43, -0.005],
];

/// Height of the body with [`AVERAGE_REST`]'s joints, from the soles to the crown, metres.
pub const AVERAGE_HEIGHT: f64 = 1.78;

/// Assumed height of a person if nothing gives it, metres.
pub const ASSUMED_HEIGHT: f64 = 1.72;
