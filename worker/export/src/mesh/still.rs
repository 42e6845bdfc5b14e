//! A mesh in one pose, for programs without bones.

use super::Mesh;
use super::cloud::unit;
use crate::gaussians::{blend, bones};
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::transform::{Mat34, apply, compose, rotate};
use yoto_capture::skeleton::{Skeleton, SkeletonError};

/// `mesh` with the bones of `skeleton` in `pose`, transformed from the world by the rigid `to`.
///
/// # Errors
/// If the pose does not fit the skeleton.
pub fn posed(
    mesh: &Mesh,
    skeleton: &Skeleton,
    pose: &Pose,
    to: &Mat34,
) -> Result<Mesh, SkeletonError> {
    skeleton.check_pose(pose)?;
    let bones = bones(skeleton, pose);
    let mut posed = mesh.clone();
    let vertices = posed.positions.iter_mut().zip(&mut posed.normals);
    for ((position, normal), shares) in vertices.zip(&mesh.bones) {
        let transform = compose(to, &blend(shares, &bones));
        *position = apply(&transform, position.map(f64::from)).map(|v| v as f32);
        // A blend of bones shears only little, so the transformed normal is near the true one, which would need
        // the inverse transpose.
        *normal = unit(rotate(&transform, normal.map(f64::from)).map(|v| v as f32));
    }
    Ok(posed)
}
