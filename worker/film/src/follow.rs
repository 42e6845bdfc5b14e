//! A camera that moves along with the body.

use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::transform::{dot, rotate, scale, sub};

/// Moves `camera`, which sees a body in the pose `first`, over the ground as the body's root moves from there to
/// the pose `now`. Jumps and crouches stay visible.
pub(crate) fn followed(camera: &Camera, first: &Pose, now: &Pose) -> Camera {
    let up = camera.world_up();
    let root = |pose: &Pose| pose.translation.map(f64::from);
    let moved = sub(root(now), root(first));
    let moved = sub(moved, scale(up, dot(moved, up)));
    // A camera that moves by d sees a point p as it saw p - d before.
    let seen = rotate(&[camera.e[0], camera.e[1], camera.e[2]], moved);
    let mut followed = camera.clone();
    for (row, seen) in followed.e.iter_mut().zip(seen) {
        row[3] -= seen;
    }
    followed
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_capture::skeleton::transform::apply;
    use yoto_synthetic::SyntheticPerson;

    #[test]
    fn a_walker_stays_where_they_are_in_the_picture_and_a_jump_is_seen() {
        let camera = SyntheticPerson::train_camera(64);
        let at = |translation| Pose {
            rotations: vec![[0.0; 3]],
            translation,
        };
        let first = at([0.25, 0.5, 0.125]);
        let up = camera.world_up();
        let seen = |camera: &Camera, pose: &Pose| {
            let [x, y, z, _] = camera.e;
            apply(&[x, y, z], pose.translation.map(f64::from))
        };
        let ahead: [f32; 3] = std::array::from_fn(|axis| match up[axis] == 0.0 {
            true => first.translation[axis] + 2.0,
            false => first.translation[axis],
        });
        let walked = at(ahead);
        let followed_camera = followed(&camera, &first, &walked);
        for (a, b) in seen(&camera, &first)
            .iter()
            .zip(seen(&followed_camera, &walked))
        {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
        let jumped = at(std::array::from_fn(|axis| {
            first.translation[axis] + up[axis] as f32
        }));
        assert_eq!(followed(&camera, &first, &jumped).e, camera.e);
    }
}
