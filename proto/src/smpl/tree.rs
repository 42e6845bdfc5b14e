//! SMPL's tree with the joints that a capture can have besides: fingers, then those of the face.

use super::{FACE, FINGERS, JOINTS};
use crate::pose_track::{PoseTrack, Skeleton};

/// Number of joints of SMPL's tree with fingers.
pub const WITH_FINGERS: usize = JOINTS.len() + FINGERS.len();
/// Number of joints of SMPL's tree with fingers and a face.
pub const WITH_FACE: usize = WITH_FINGERS + FACE.len();

/// All joints in their order: [`JOINTS`], then [`FINGERS`], then those of the [`FACE`].
pub fn all_joints() -> impl Iterator<Item = (&'static str, Option<usize>)> {
    JOINTS.into_iter().chain(FINGERS).chain(FACE)
}

/// Whether joints with these names and parents are those of SMPL in its order, alone, with fingers, or with fingers and a face.
pub fn is_smpls_tree<'a>(joints: impl ExactSizeIterator<Item = (&'a str, Option<usize>)>) -> bool {
    [JOINTS.len(), WITH_FINGERS, WITH_FACE].contains(&joints.len())
        && joints.zip(all_joints()).all(|(own, known)| own == known)
}

/// Whether the joints are those of SMPL, as in [`is_smpls_tree`].
pub fn is_smpls(skeleton: &Skeleton) -> bool {
    let parents = skeleton.parents.iter();
    let parents = parents.map(|parent| usize::try_from(*parent).ok());
    is_smpls_tree(skeleton.names.iter().map(String::as_str).zip(parents))
}

/// Leaves SMPL's joints of a track that has fingers or a face. Other tracks are not changed.
pub fn drop_parts(track: &mut PoseTrack) {
    let count = JOINTS.len();
    if track.joints() == count || !is_smpls(&track.skeleton) {
        return;
    }
    track.skeleton.names.truncate(count);
    track.skeleton.parents.truncate(count);
    track.skeleton.rest_joints.truncate(count);
    for frame in &mut track.frames {
        frame.pose.truncate(3 * count);
    }
}
