//! The Jacobian of rays: the gradient of one number per ray to every joint.
//!
//! A bone that rotates by ω about its joint at p leaves a point x of the body frame behind by
//! −ω × (x − p). With the gradient f to the point as the bone carries it, rotated into the body
//! frame, the ray changes by −ω · ((x − p) × f), summed over all bones below the joint.

use super::wrench::{self, Wrench};
use crate::avatar::Posed;
use crate::config::Unposing;
use crate::host::read;
use crate::motion::body::CanonicalBody;
use crate::render::RenderError;
use crate::render::samples::Samples;
use rayon::prelude::*;
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::transform::Mat34;
use yoto_ops::warp::inverse::point_gradients as unposed;
use yoto_ops::warp::point_gradients::{PointGradient, point_gradients};

/// A posed body in host memory.
pub(super) struct HostPose {
    /// `[K + 1, V]` motion weights.
    pub weights: Vec<f32>,
    /// `[J, 12]` posed body to canonical, of fingers' joints too.
    pub transforms: Vec<f32>,
    /// Place of each joint in the body frame.
    pub joints: Vec<Mat34>,
}

impl HostPose {
    pub(super) fn new(
        body: &CanonicalBody,
        pose: &Pose,
        posed: &Posed,
    ) -> Result<Self, RenderError> {
        Ok(Self {
            weights: read(posed.weights.clone().detach())?,
            transforms: read(posed.transforms.clone().detach())?,
            joints: body.skeleton.global_transforms(&pose.unrooted()),
        })
    }
}

/// The Jacobian `[R, 3 (K + 1)]` of the rays to the pose, as [`wrench::jacobian`] returns it. `to_warped`
/// `[n, 4]` are the gradients to the samples' canonical points and likelihoods.
pub(super) fn rays(
    body: &CanonicalBody,
    pose: &HostPose,
    unposing: Unposing,
    samples: &Samples,
    mut to_warped: Vec<f32>,
) -> Vec<f64> {
    let HostPose {
        weights,
        transforms,
        joints,
    } = pose;
    let transforms = &transforms[..12 * body.known_joints];
    let bones = joints.len();
    let (points, _) = samples.points.as_chunks::<3>();
    let ray = |point: u32| samples.places[point as usize] as usize / samples.per_ray;
    let mut blocks = match unposing {
        Unposing::Blend => Vec::new(),
        Unposing::Inverse => {
            let canonical = &samples.canonical;
            let (points, grid) = (&samples.points, &body.grid);
            unposed::point_gradients(weights, transforms, points, canonical, &mut to_warped, grid)
        }
    };
    let carried = point_gradients(weights, transforms, &samples.points, &to_warped, &body.grid);
    blocks.extend(carried.into_iter().map(|block| {
        let in_body = |at: PointGradient| {
            let bone = at.bone as usize;
            let (carry, _) = transforms[12 * bone..12 * (bone + 1)].as_chunks::<4>();
            unposed::PointGradient {
                point: at.point,
                bone: at.bone,
                position: points[at.point as usize],
                gradient: std::array::from_fn(|c| {
                    let along = carry.iter().zip(at.gradient);
                    along.map(|(row, f)| row[c] * f).sum()
                }),
            }
        };
        block.into_iter().map(in_body).collect()
    }));
    let blocks: Vec<(usize, Vec<Wrench>)> = (blocks.par_iter())
        .filter(|block| !block.is_empty())
        .map(|block| {
            let rays = block.iter().map(|at| ray(at.point));
            let (first, last) = rays.fold((usize::MAX, 0), |(a, b), it| (a.min(it), b.max(it)));
            let mut wrenches = vec![Wrench::default(); (last + 1 - first) * bones];
            for at in block {
                // The body moves, the point stays.
                let force = at.gradient.map(|v| -f64::from(v));
                let bone = at.bone as usize;
                wrenches[(ray(at.point) - first) * bones + bone]
                    .add(Wrench::at(at.position.map(f64::from), force));
            }
            (first, wrenches)
        })
        .collect();
    let mut wrenches = vec![Wrench::default(); samples.rays * bones];
    for (first, block) in blocks {
        for (sum, wrench) in wrenches[first * bones..].iter_mut().zip(block) {
            sum.add(wrench);
        }
    }
    wrench::jacobian(&body.skeleton, joints, wrenches)
}

#[cfg(test)]
#[path = "jacobian_tests.rs"]
mod tests;
