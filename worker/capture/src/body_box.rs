//! The box that a frame's rays are cut to, as its camera sees it.
//!
//! It stands around the posed joints, 0.3 m wider on every side, upright in the body frame.
//! A protocol that blackens everything outside it measures no background, and no limb that
//! the model puts far away either; a mask that reaches outside it can't be learnt.

use crate::camera::Camera;
use crate::skeleton::kinematics::Bounds;
use crate::skeleton::transform::{Mat34, Vec3, apply, inverse, position, rotate};
use crate::skeleton::{Pose, Skeleton};

/// How far the box reaches beyond the posed joints, metres (HumanNeRF).
const MARGIN: f64 = 0.3;

/// The box of one frame.
pub struct ProjectedBox<'a> {
    camera: &'a Camera,
    bounds: Bounds,
    to_body: Mat34,
    to_world: Mat34,
}

impl<'a> ProjectedBox<'a> {
    /// None for a skeleton without joints.
    pub fn new(skeleton: &Skeleton, pose: &Pose, camera: &'a Camera) -> Option<Self> {
        let mut rotations = pose.rotations_f64();
        if let Some(root) = rotations.first_mut() {
            *root = [0.0; 3];
        }
        let transforms = skeleton.global_transforms(&rotations);
        let joints: Vec<Vec3> = transforms.iter().map(position).collect();
        let to_world = skeleton.body_to_world(pose);
        Some(Self {
            camera,
            bounds: Bounds::around(&joints, MARGIN)?,
            to_body: inverse(&to_world),
            to_world,
        })
    }

    /// Whether the ray through image coordinates `u`, `v` (pixels) meets it.
    pub fn holds(&self, u: f64, v: f64) -> bool {
        let (origin, direction) = self.camera.ray(u, v);
        let origin = apply(&self.to_body, origin);
        meets(&self.bounds, origin, rotate(&self.to_body, direction))
    }

    /// Its corners in the image, pixels; none for one behind the camera. Bit i of a corner's
    /// number is its end of axis i, so an edge joins numbers that differ in one bit.
    pub fn corners(&self) -> [Option<[f64; 2]>; 8] {
        std::array::from_fn(|corner| {
            let ends = [self.bounds.min, self.bounds.max];
            let point = std::array::from_fn(|axis| ends[(corner >> axis) & 1][axis]);
            self.camera.project(apply(&self.to_world, point))
        })
    }
}

/// One entry a pixel, row by row: whether the ray through its centre misses the box.
pub fn outside(skeleton: &Skeleton, pose: &Pose, camera: &Camera) -> Vec<bool> {
    let Some(projected) = ProjectedBox::new(skeleton, pose, camera) else {
        return vec![true; camera.width as usize * camera.height as usize];
    };
    let pixels = (0..camera.height).flat_map(|y| (0..camera.width).map(move |x| (x, y)));
    pixels
        .map(|(x, y)| !projected.holds(f64::from(x) + 0.5, f64::from(y) + 0.5))
        .collect()
}

/// Whether a half-line meets a box.
fn meets(bounds: &Bounds, origin: Vec3, direction: Vec3) -> bool {
    let (mut near, mut far) = (0.0f64, f64::INFINITY);
    for axis in 0..3 {
        let (low, high) = (
            bounds.min[axis] - origin[axis],
            bounds.max[axis] - origin[axis],
        );
        if direction[axis] == 0.0 {
            if low > 0.0 || high < 0.0 {
                return false;
            }
            continue;
        }
        let (one, other) = (low / direction[axis], high / direction[axis]);
        near = near.max(one.min(other));
        far = far.min(one.max(other));
    }
    near < far
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
