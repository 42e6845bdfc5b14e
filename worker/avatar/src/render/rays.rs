//! Rays in the body frame, cut to the box around the posed joints.

use crate::motion::body::Body;
use crate::motion::posed::body_frame_joints;
use yoto_capture::camera::{Camera, Pose};

/// The box reaches this far beyond the posed joints, metres (HumanNeRF).
const BOX_MARGIN: f64 = 0.3;
/// A direction component smaller than this makes a ray parallel to the slab.
const PARALLEL: f64 = 1e-9;

/// A camera in the body frame of one pose, and the body's box in it.
pub struct BodyView {
    /// Body frame to camera: rotation.
    rotation: [[f64; 3]; 3],
    /// Camera centre in the body frame, metres.
    pub(super) origin: [f64; 3],
    k: [[f64; 3]; 3],
    /// Box around the posed joints, metres.
    pub(super) low: [f64; 3],
    pub(super) high: [f64; 3],
}

/// The part of a ray inside the box. Distances are multiples of the direction, whose camera z is 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Camera centre, metres.
    pub origin: [f32; 3],
    /// Not normalised.
    pub direction: [f32; 3],
    /// Where the ray enters the box, or 0 when the camera is inside.
    pub near: f32,
    /// Where the ray leaves the box.
    pub far: f32,
}

impl BodyView {
    /// View of `body` in `pose`. The root's rotation and translation move the camera:
    /// E' = E · (body to world).
    pub fn new(body: &Body, pose: &Pose, camera: &Camera) -> Self {
        let to_world = body.skeleton.body_to_world(pose);
        let e = &camera.e;
        let rotation: [[f64; 3]; 3] = std::array::from_fn(|i| {
            std::array::from_fn(|j| (0..3).map(|c| e[i][c] * to_world[c][j]).sum())
        });
        let t: [f64; 3] = std::array::from_fn(|i| {
            e[i][3] + (0..3).map(|c| e[i][c] * to_world[c][3]).sum::<f64>()
        });
        let origin = std::array::from_fn(|j| -(0..3).map(|i| rotation[i][j] * t[i]).sum::<f64>());
        let joints = body_frame_joints(body, pose);
        let bound = |a: usize, pick: fn(f64, f64) -> f64, start: f64| {
            joints.iter().map(|j| j[a]).fold(start, pick)
        };
        Self {
            rotation,
            origin,
            k: camera.k,
            low: std::array::from_fn(|a| bound(a, f64::min, f64::INFINITY) - BOX_MARGIN),
            high: std::array::from_fn(|a| bound(a, f64::max, f64::NEG_INFINITY) + BOX_MARGIN),
        }
    }

    /// Direction of the ray through image position (`u`, `v`), with camera z = 1.
    pub(super) fn direction(&self, u: f64, v: f64) -> [f64; 3] {
        let y = (v - self.k[1][2]) / self.k[1][1];
        let x = (u - self.k[0][2] - self.k[0][1] * y) / self.k[0][0];
        let in_camera = [x, y, 1.0];
        std::array::from_fn(|j| (0..3).map(|i| self.rotation[i][j] * in_camera[i]).sum())
    }

    /// The ray through image position (`u`, `v`), pixels from the image's corner; `None` when
    /// it misses the box.
    pub fn ray(&self, u: f64, v: f64) -> Option<Ray> {
        let direction = self.direction(u, v);
        let (mut near, mut far) = (0f64, f64::INFINITY);
        for (a, along) in direction.into_iter().enumerate() {
            let (low, high) = (self.low[a] - self.origin[a], self.high[a] - self.origin[a]);
            if along.abs() < PARALLEL {
                if low > 0.0 || high < 0.0 {
                    return None;
                }
                continue;
            }
            let (one, other) = (low / along, high / along);
            near = near.max(one.min(other));
            far = far.min(one.max(other));
        }
        // Also false if a value above is not a number.
        (near < far && far.is_finite()).then(|| Ray {
            origin: self.origin.map(|v| v as f32),
            direction: direction.map(|v| v as f32),
            near: near as f32,
            far: far as f32,
        })
    }
}
