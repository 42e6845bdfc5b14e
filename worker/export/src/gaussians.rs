//! A person in one pose as Gaussians in space, for programs without bones and lighting.

use crate::shine;
use faer::{Mat, Side};
use yoto_avatar::render::{SkinnedSplat, SkinnedSplats};
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::transform::{
    IDENTITY_ROTATION, Mat3, Mat34, apply, compose, from_quaternion, rigid, to_quaternion,
};
use yoto_capture::skeleton::{Skeleton, SkeletonError};
use yoto_formats::splats::Gaussian;
use yoto_ops::splat::light::terms;

/// Smallest standard deviation, metres: skinning may flatten a Gaussian to nothing.
const THINNEST: f64 = 1e-6;

/// The person in `pose` with the light of their capture, transformed from the world by the rigid `to`.
///
/// # Errors
/// If the pose does not fit the person's skeleton.
pub fn posed(
    person: &SkinnedSplats,
    pose: &Pose,
    to: &Mat34,
) -> Result<Vec<Gaussian>, SkeletonError> {
    person.skeleton.check_pose(pose)?;
    let bones = bones(&person.skeleton, pose);
    let splats = person.shaped(pose);
    Ok(splats
        .iter()
        .map(|splat| carried(splat, &bones, &person.light, to))
        .collect())
}

/// For each bone, the transformation from the rest pose to the world.
pub(crate) fn bones(skeleton: &Skeleton, pose: &Pose) -> Vec<Mat34> {
    let posed = skeleton.world_transforms(pose);
    let back = |rest: &[f64; 3]| rigid(IDENTITY_ROTATION, rest.map(|v| -v));
    let joints = posed.iter().zip(&skeleton.rest);
    joints
        .map(|(joint, rest)| compose(joint, &back(rest)))
        .collect()
}

/// The splats' colours `[N, 3]`, each viewed along its normal, in the mean light of `poses`, or in that of the rest pose
/// without any.
///
/// # Errors
/// If a pose does not fit the person's skeleton.
pub(crate) fn mean_colours(
    person: &SkinnedSplats,
    poses: &[Pose],
) -> Result<Vec<[f32; 3]>, SkeletonError> {
    let rest = [Pose::rest(person.skeleton.joints())];
    let poses = if poses.is_empty() { &rest } else { poses };
    let mut shades = vec![[0.0f32; 3]; person.splats.len()];
    for pose in poses {
        person.skeleton.check_pose(pose)?;
        let bones = bones(&person.skeleton, pose);
        for (sum, splat) in shades.iter_mut().zip(&person.splats) {
            let axes = posed_axes(splat, &blend(&splat.bones, &bones));
            let shade = shade(&axes, &person.light);
            let part = 1.0 / poses.len() as f32;
            *sum = std::array::from_fn(|c| sum[c] + part * shade[c]);
        }
    }
    let colours = shades.iter().zip(&person.splats).map(|(shade, splat)| {
        let inward = from_quaternion(splat.rotation.map(f64::from)).map(|row| -row[2]);
        let gained = shine::gained(&splat.harmonics, inward);
        std::array::from_fn(|c| shade[c] * (splat.colour[c] + gained[c]))
    });
    Ok(colours.collect())
}

/// A splat, transformed by its bones.
fn carried(splat: &SkinnedSplat, bones: &[Mat34], light: &[[f32; 8]; 3], to: &Mat34) -> Gaussian {
    let transform = blend(&splat.bones, bones);
    let axes = posed_axes(splat, &transform);
    let shade = shade(&axes, light);
    let moved = |by: &dyn Fn(usize, usize) -> f64| -> Mat3 {
        let entry = |r: usize, c: usize| (0..3).map(|k| to[r][k] * by(k, c)).sum::<f64>();
        std::array::from_fn(|r| std::array::from_fn(|c| entry(r, c)))
    };
    let (rotation, deviations) =
        ellipsoid(&moved(&|k, c| axes[k][c]), splat.deviations.map(f64::from));
    let harmonics = shine::rotated(&splat.harmonics, &moved(&|k, c| transform[k][c]));
    Gaussian {
        mean: apply(to, apply(&transform, splat.mean.map(f64::from))).map(|v| v as f32),
        rotation: to_quaternion(&rotation).map(|v| v as f32),
        deviations: deviations.map(|v| v as f32),
        opacity: splat.opacity,
        colour: std::array::from_fn(|c| (splat.colour[c] * shade[c]).clamp(0.0, 1.0)),
        harmonics: harmonics.map(|own| std::array::from_fn(|c| own[c] * shade[c])),
    }
}

/// The transformation of a point to the world by linear blend skinning: the mean of its bones' transformations, weighted
/// by their shares.
pub(crate) fn blend(shares: &[(u16, f32)], bones: &[Mat34]) -> Mat34 {
    let mut transform: Mat34 = [[0.0; 4]; 3];
    for (bone, share) in shares {
        for (sum, row) in transform.iter_mut().zip(&bones[usize::from(*bone)]) {
            for (sum, value) in sum.iter_mut().zip(row) {
                *sum += f64::from(*share) * value;
            }
        }
    }
    transform
}

/// A splat's axes in the world, column by column. They may be sheared, since a blend of rotations is no rotation.
fn posed_axes(splat: &SkinnedSplat, transform: &Mat34) -> Mat3 {
    let axes = from_quaternion(splat.rotation.map(f64::from));
    let linear = |r: usize, c: usize| (0..3).map(|k| transform[r][k] * axes[k][c]).sum::<f64>();
    std::array::from_fn(|r| std::array::from_fn(|c| linear(r, c)))
}

/// The light on a splat by channel; the third of its axes is its normal.
fn shade(axes: &Mat3, light: &[[f32; 8]; 3]) -> [f32; 3] {
    let length = axes
        .iter()
        .map(|row| row[2] * row[2])
        .sum::<f64>()
        .sqrt()
        .max(THINNEST);
    let terms = terms(axes.map(|row| (row[2] / length) as f32));
    light.map(|own| 1.0 + own.iter().zip(&terms).map(|(a, b)| a * b).sum::<f32>())
}

/// Rotation and standard deviations of the Gaussian with the covariance (A S)(A S)ᵀ.
fn ellipsoid(axes: &Mat3, deviations: [f64; 3]) -> (Mat3, [f64; 3]) {
    let entry = |r: usize, c: usize| -> f64 {
        (0..3)
            .map(|k| axes[r][k] * axes[c][k] * deviations[k] * deviations[k])
            .sum()
    };
    let covariance = Mat::from_fn(3, 3, entry);
    // A symmetric matrix of finite numbers always has eigenvectors.
    let Ok(found) = covariance.self_adjoint_eigen(Side::Lower) else {
        return (IDENTITY_ROTATION, [f64::NAN; 3]);
    };
    let (vectors, values) = (found.U(), found.S());
    let mut rotation: Mat3 = std::array::from_fn(|r| std::array::from_fn(|c| vectors[(r, c)]));
    let [[a, b, c], [d, e, f], [g, h, i]] = rotation;
    // With a negative determinant the eigenvectors are a reflection, which has no quaternion.
    if a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) < 0.0 {
        rotation.iter_mut().for_each(|row| row[2] = -row[2]);
    }
    (
        rotation,
        std::array::from_fn(|k| values[k].max(0.0).sqrt().max(THINNEST)),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sheared_gaussian_keeps_its_covariance() {
        let axes = [[1.0, 0.4, 0.0], [0.1, 0.8, -0.3], [0.0, 0.2, 1.1]];
        let deviations = [0.02, 0.01, 0.003];
        let (turn, found) = ellipsoid(&axes, deviations);
        let covariance = |axes: &Mat3, deviations: [f64; 3], r: usize, c: usize| -> f64 {
            (0..3)
                .map(|k| axes[r][k] * axes[c][k] * deviations[k].powi(2))
                .sum()
        };
        for r in 0..3 {
            for c in 0..3 {
                let off = covariance(&axes, deviations, r, c) - covariance(&turn, found, r, c);
                assert!(off.abs() < 1e-12, "{r} {c}: {off}");
            }
        }
    }
}
