//! The transformation from the axes of the camera, where a body is fitted, to a world where people stand
//! upright: orbits and motions rotate about the world's up.

use crate::rotation::{log_map, matmul, matvec, transpose};
use crate::skeleton::COUNT;
use yoto_capture::skeleton::Vec3;
use yoto_capture::skeleton::transform::{Mat3, add, rodrigues, sub};

/// The world of one static camera.
pub(crate) struct World {
    /// Rotation from the camera's axes to the world's.
    rotation: Mat3,
}

impl World {
    /// The world of a camera with the pitch `down` and the roll `roll`, radians, as in
    /// [`upright::up`](crate::residuals::upright::up). Its origin is the camera, and its y axis points down
    /// along gravity.
    pub(crate) fn of_camera(down: f64, roll: f64) -> Self {
        Self {
            rotation: matmul(&rodrigues([-down, 0.0, 0.0]), &rodrigues([0.0, 0.0, -roll])),
        }
    }

    /// Axis-angle vectors of all joints, with the root's in the world.
    pub(crate) fn pose(&self, rotations: &[Mat3; COUNT]) -> Vec<f64> {
        let mut rotations = *rotations;
        rotations[0] = matmul(&self.rotation, &rotations[0]);
        rotations.iter().flat_map(log_map).collect()
    }

    /// The translation in the world of a root with the rest position `rest` and the translation `by` in the
    /// camera's axes.
    pub(crate) fn translation(&self, rest: Vec3, by: Vec3) -> Vec3 {
        sub(matvec(&self.rotation, add(rest, by)), rest)
    }

    /// The world-to-camera matrix.
    pub(crate) fn extrinsics(&self) -> [[f64; 4]; 4] {
        let back = transpose(&self.rotation);
        std::array::from_fn(|i| {
            std::array::from_fn(|j| match (back.get(i), j) {
                (Some(row), 0..3) => row[j],
                _ => f64::from(u8::from(i == j)),
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residuals::upright::up;

    #[test]
    fn gravity_becomes_the_worlds_y_and_the_camera_sees_the_same() {
        let world = World::of_camera(0.3, 0.1);
        let [sky, ..] = up(0.3, 0.1);
        for (value, wanted) in matvec(&world.rotation, sky).iter().zip([0.0, -1.0, 0.0]) {
            assert!((value - wanted).abs() < 1e-12, "{value} {wanted}");
        }
        let (rest, by) = ([0.1, 0.9, 0.0], [0.3, -0.2, 3.0]);
        let position = add(rest, world.translation(rest, by));
        let e = world.extrinsics();
        for (axis, wanted) in add(rest, by).iter().enumerate() {
            let seen: f64 = (0..3).map(|j| e[axis][j] * position[j]).sum();
            assert!((seen - wanted).abs() < 1e-12, "{seen} {wanted}");
        }
        assert_eq!(e[3], [0.0, 0.0, 0.0, 1.0]);
    }
}
