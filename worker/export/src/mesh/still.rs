//! A mesh in one pose, for programs that know no bones.

use super::Mesh;
use super::cloud::unit;
use crate::gaussians::{blend, bones};
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::transform::{Mat34, apply, compose, rotate};
use yoto_capture::skeleton::{Skeleton, SkeletonError};

/// `mesh` with the bones of `skeleton` in `pose`, carried from the world by the rigid `to`.
///
/// # Errors
/// If the pose is not of the skeleton.
pub fn posed(
    mesh: &Mesh,
    skeleton: &Skeleton,
    pose: &Pose,
    to: &Mat34,
) -> Result<Mesh, SkeletonError> {
    skeleton.check_pose(pose)?;
    let bones = bones(skeleton, pose);
    let mut posed = mesh.clone();
    let places = posed.positions.iter_mut().zip(&mut posed.normals);
    for ((position, normal), shares) in places.zip(&mesh.bones) {
        let transform = compose(to, &blend(shares, &bones));
        *position = apply(&transform, position.map(f64::from)).map(|v| v as f32);
        // Shares of bones shear little: the normal of the sheared surface is near the sheared normal.
        *normal = unit(rotate(&transform, normal.map(f64::from)).map(|v| v as f32));
    }
    Ok(posed)
}
