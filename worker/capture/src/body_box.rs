//! The box that a frame's rays are cut to, as its camera sees it.
//!
//! It stands around the posed joints, 0.3 m wider on every side, upright in the body frame.
//! A protocol that blackens everything outside it measures no background, and no limb that
//! the model puts far away either; a mask that reaches outside it can't be learnt.

use crate::camera::Camera;
use crate::skeleton::{Bounds, Pose, Skeleton, Vec3};

/// Margin of the boxes around joints, metres (HumanNeRF, `bbox_offset`).
pub const MARGIN: f64 = 0.3;

/// A camera moved into the body frame of one pose, and the body's box there.
#[derive(Clone, Debug)]
pub struct BodyView {
    /// The camera, with the body frame as its world: E' = E · (body to world).
    camera: Camera,
    /// The camera's centre in the body frame, metres.
    pub origin: Vec3,
    /// The box around the posed joints in the body frame, metres.
    pub bounds: Bounds,
}

/// The segment of a ray inside the box. Distances are multiples of the direction, which has a camera z
/// of 1, so they are depths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Camera centre, metres.
    pub origin: [f32; 3],
    /// Direction, not normalised: its camera z is 1.
    pub direction: [f32; 3],
    /// Where the ray enters the box, or 0 when the camera is inside.
    pub near: f32,
    /// Where it leaves.
    pub far: f32,
}

impl BodyView {
    /// The box of a body in `pose`, seen by `camera`.
    pub fn new(skeleton: &Skeleton, pose: &Pose, camera: &Camera) -> Self {
        let camera = camera.in_frame(&skeleton.body_to_world(pose));
        Self {
            origin: camera.centre(),
            camera,
            bounds: Bounds::around(&skeleton.body_frame_joints(pose), MARGIN),
        }
    }

    /// The direction through image position (`u`, `v`) in the body frame, at camera z = 1.
    pub fn direction(&self, u: f64, v: f64) -> Vec3 {
        self.camera.direction(u, v)
    }

    /// The ray through image position (`u`, `v`), pixels from the image's corner; `None` when
    /// it misses the box.
    pub fn ray(&self, u: f64, v: f64) -> Option<Ray> {
        let direction = self.direction(u, v);
        let (near, far) = self.bounds.cut(self.origin, direction)?;
        Some(Ray {
            origin: self.origin.map(|v| v as f32),
            direction: direction.map(|v| v as f32),
            near: near as f32,
            far: far as f32,
        })
    }

    /// The box's corners in the image, pixels; `None` for a corner behind the camera. Bit i of a
    /// corner's index is its end of axis i, so an edge joins indices that differ in one bit.
    pub fn corners(&self) -> [Option<[f64; 2]>; 8] {
        std::array::from_fn(|corner| {
            let ends = [self.bounds.min, self.bounds.max];
            let point = std::array::from_fn(|axis| ends[(corner >> axis) & 1][axis]);
            self.camera.project(point)
        })
    }
}

/// For each pixel, row by row, whether the ray through its centre misses the box.
pub fn outside(skeleton: &Skeleton, pose: &Pose, camera: &Camera) -> Vec<bool> {
    let view = BodyView::new(skeleton, pose, camera);
    let pixels = (0..camera.height).flat_map(|y| (0..camera.width).map(move |x| (x, y)));
    pixels
        .map(|(x, y)| view.ray(f64::from(x) + 0.5, f64::from(y) + 0.5).is_none())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_box_of_a_lone_joint_is_a_square_of_its_size() {
        let skeleton = Skeleton {
            names: vec!["root".into()],
            parents: vec![None],
            rest: vec![[0.0; 3]],
        };
        // 3 m in front of the joint; 2.7 m in front of the box's near side, 0.6 m wide.
        let (up, centre) = ([0.0, 1.0, 0.0], [0.0; 3]);
        let camera = Camera::look_at([0.0, 0.0, 3.0], centre, up, 90.0, 40, 40);
        let seen = |pose: &Pose| {
            let outside = outside(&skeleton, pose, &camera);
            let inside: Vec<usize> = (0..1600).filter(|&i| !outside[i]).collect();
            let columns = inside.iter().map(|i| i % 40);
            let bounds = (columns.clone().min(), columns.max());
            (inside.len(), bounds)
        };
        let mut pose = Pose::rest(1);
        // 90 * 0.3 / 2.7 = 10 pixels to either side of the middle.
        assert_eq!(seen(&pose), (400, (Some(10), Some(29))));
        // The box turns with the body: on its edge it is wider.
        pose.rotations[0] = [0.0, std::f32::consts::FRAC_PI_4, 0.0];
        assert!(seen(&pose).0 > 400);
        pose.translation = [0.0, 0.0, 10.0];
        assert_eq!(seen(&pose).0, 0, "behind the camera");
    }
}
