//! How rays change with the pose: the gradient of one number per ray to every joint.
//!
//! A bone that turns by ω about its joint at p leaves a point x of the body frame behind by
//! −ω × (x − p). With the gradient f to the point as the bone carries it, turned into the body
//! frame, the ray changes by −ω · ((x − p) × f), summed over all bones below the joint.

use crate::avatar::Posed;
use crate::motion::body::Body;
use crate::ops::warp::pulls::pulls;
use crate::render::RenderError;
use crate::render::frame::read;
use crate::render::march::Samples;
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::transform::{Mat34, Vec3, add, cross, inverse, position, rotate, sub};

/// A posed body in host memory.
pub(super) struct HostPose {
    /// `[K + 1, D³]` motion weights.
    pub weights: Vec<f32>,
    /// `[K, 12]` posed body to canonical.
    pub transforms: Vec<f32>,
    /// Place of each joint in the body frame.
    joints: Vec<Mat34>,
}

impl HostPose {
    pub fn new(body: &Body, pose: &Pose, posed: &Posed) -> Result<Self, RenderError> {
        Ok(Self {
            weights: read(posed.weights.clone().detach())?,
            transforms: read(posed.transforms.clone().detach())?,
            joints: body.skeleton.global_transforms(&pose.unrooted()),
        })
    }
}

/// A force and its moment about the origin.
#[derive(Clone, Copy, Default)]
struct Wrench {
    force: Vec3,
    moment: Vec3,
}

impl Wrench {
    fn add(&mut self, other: Self) {
        self.force = add(self.force, other.force);
        self.moment = add(self.moment, other.moment);
    }
}

/// `[R, 3 (K + 1)]`: gradients of the rays to the rotation of each joint by a vector in its own
/// posed axes, radians, and to the shift of the root in its own axes, metres. `to_warped` `[n, 4]`
/// are the gradients to the samples' canonical points and likelihoods.
pub(super) fn rows(body: &Body, pose: &HostPose, samples: &Samples, to_warped: &[f32]) -> Vec<f64> {
    let joints = pose.joints.len();
    let mut wrenches = vec![Wrench::default(); samples.rays * joints];
    let (points, _) = samples.points.as_chunks::<3>();
    let HostPose {
        weights,
        transforms,
        ..
    } = pose;
    for pull in pulls(weights, transforms, &samples.points, to_warped, &body.grid) {
        let (point, bone) = (pull.point as usize, pull.bone as usize);
        let (carry, _) = transforms[12 * bone..12 * (bone + 1)].as_chunks::<4>();
        let force = std::array::from_fn(|c| {
            let along = carry.iter().zip(pull.force);
            along.map(|(row, f)| f64::from(row[c]) * f64::from(f)).sum()
        });
        let ray = samples.places[point] as usize / samples.per_ray;
        wrenches[ray * joints + bone].add(Wrench {
            force,
            moment: cross(points[point].map(f64::from), force),
        });
    }
    let width = 3 * (joints + 1);
    let mut rows = vec![0.0; samples.rays * width];
    let rays = wrenches.chunks_exact_mut(joints);
    for (wrenches, row) in rays.zip(rows.chunks_exact_mut(width)) {
        // Parents come before their children.
        for joint in (0..joints).rev() {
            let below = wrenches[joint];
            if let Some(parent) = body.skeleton.parents[joint] {
                wrenches[parent].add(below);
            }
            let place = &pose.joints[joint];
            let about = sub(below.moment, cross(position(place), below.force));
            let turn = rotate(&inverse(place), about).map(|v| -v);
            row[3 * joint..3 * joint + 3].copy_from_slice(&turn);
        }
        row[3 * joints..].copy_from_slice(&wrenches[0].force.map(|v| -v));
    }
    rows
}

#[cfg(test)]
#[path = "jacobian_tests.rs"]
mod tests;
