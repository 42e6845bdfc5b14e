//! Which pixels of a picture lie outside the person's projected box.
//!
//! The box is the one rays are cut to: around the posed joints, 0.3 m wider on every side,
//! upright in the body frame. A protocol that blackens everything outside it measures no
//! background, and no limb that the model puts far away either.

use crate::camera::Camera;
use crate::skeleton::kinematics::Bounds;
use crate::skeleton::transform::{Vec3, apply, inverse, position, rotate};
use crate::skeleton::{Pose, Skeleton};

/// How far the box reaches beyond the posed joints, metres (HumanNeRF).
const MARGIN: f64 = 0.3;

/// One entry a pixel, row by row: whether the ray through its centre misses the box.
pub(super) fn outside(skeleton: &Skeleton, pose: &Pose, camera: &Camera) -> Vec<bool> {
    let mut rotations = pose.rotations_f64();
    if let Some(root) = rotations.first_mut() {
        *root = [0.0; 3];
    }
    let transforms = skeleton.global_transforms(&rotations);
    let joints: Vec<Vec3> = transforms.iter().map(position).collect();
    let Some(bounds) = Bounds::around(&joints, MARGIN) else {
        return vec![true; camera.width as usize * camera.height as usize];
    };
    let to_body = inverse(&skeleton.body_to_world(pose));
    let pixels = (0..camera.height).flat_map(|y| (0..camera.width).map(move |x| (x, y)));
    pixels
        .map(|(x, y)| {
            let (origin, direction) = camera.ray(f64::from(x) + 0.5, f64::from(y) + 0.5);
            let origin = apply(&to_body, origin);
            !meets(&bounds, origin, rotate(&to_body, direction))
        })
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
