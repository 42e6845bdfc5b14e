//! The camera that sees which part of the ground people shade.

use yoto_capture::camera::Camera;
use yoto_capture::skeleton::transform::{Vec3, add, scale};

/// Height of the light that casts the shadow, metres: shadows of heads are at most 2 % larger than those of
/// feet.
pub const LIGHT_HEIGHT: f64 = 100.0;
/// Side of the picture of the shadow, pixels.
const SHADOW_SIDE: u32 = 256;
/// What people reach beyond their joints, metres.
const REACH: f64 = 0.35;

/// A camera above the `joints` that sees all of them; `None` without joints.
pub(crate) fn from_above(joints: &[Vec3]) -> Option<Camera> {
    let sum = joints.iter().fold([0.0; 3], |sum, joint| add(sum, *joint));
    let [x, _, z] = scale(sum, 1.0 / joints.len().max(1) as f64);
    let far = |joint: &Vec3| (joint[0] - x).abs().max((joint[2] - z).abs());
    let widest = joints.iter().map(far).reduce(f64::max)? + REACH;
    let focal = 0.5 * f64::from(SHADOW_SIDE) * LIGHT_HEIGHT / widest;
    let (eye, ground) = ([x, LIGHT_HEIGHT, z], [x, 0.0, z]);
    let up = [0.0, 0.0, -1.0];
    let side = SHADOW_SIDE;
    Some(Camera::look_at(eye, ground, up, focal, side, side))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everybody_is_in_the_picture_from_above() {
        let joints = [[2.0, 1.7, -1.0], [2.4, 0.1, -1.0], [-3.0, 0.9, 4.0]];
        let camera = from_above(&joints).expect("somebody is there");
        for joint in joints {
            let [u, v] = camera.project(joint).expect("below the light");
            let inside = 0.0..f64::from(SHADOW_SIDE);
            assert!(inside.contains(&u) && inside.contains(&v), "{u} {v}");
        }
        assert_eq!(from_above(&[]), None);
    }
}
