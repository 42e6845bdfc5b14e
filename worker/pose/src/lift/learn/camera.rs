//! Random cameras.

use super::motion::ClipFrame;
use super::{LONGER, normal};
use crate::initial::FACING;
use crate::parameters::Stance;
use crate::rotation::{matmul, matvec};
use rand::{Rng, RngExt};
use yoto_capture::skeleton::Vec3;
use yoto_capture::skeleton::transform::{Mat3, add, rodrigues, sub};

/// Mean and standard deviation of the logarithm of the focal length in longer sides.
const FOCAL: [f64; 2] = [0.18, 0.22];
/// Mean and standard deviation of the camera's downward pitch, radians, and its limits.
const PITCH: [f64; 2] = [0.05, 0.16];
const PITCH_RANGE: [f64; 2] = [-0.5, 0.7];
/// Standard deviation of the camera's roll, radians.
const ROLL: f64 = 0.03;
/// Range of the body's height in the picture, in longer sides, and of the place of its root from the middle.
const SHARE: [f64; 2] = [0.3, 0.95];
const PLACE: [f64; 2] = [0.25, 0.12];
/// Height of an average body, metres.
const HEIGHT: f64 = 1.75;

/// A camera, and where the person is before it.
pub(super) struct RandomCamera {
    rotation: Mat3,
    pub focal: f64,
    place: Vec3,
}

impl RandomCamera {
    pub(super) fn draw(random: &mut impl Rng) -> Self {
        let focal = LONGER * (FOCAL[0] + FOCAL[1] * normal(random)).exp();
        let pitch = (PITCH[0] + PITCH[1] * normal(random)).clamp(PITCH_RANGE[0], PITCH_RANGE[1]);
        let roll = ROLL * normal(random);
        let yaw = random.random_range(0.0..std::f64::consts::TAU);
        let turned = matmul(&FACING, &rodrigues([0.0, yaw, 0.0]));
        let rotation = matmul(
            &rodrigues([0.0, 0.0, roll]),
            &matmul(&rodrigues([pitch, 0.0, 0.0]), &turned),
        );
        let depth = focal * HEIGHT / (LONGER * random.random_range(SHARE[0]..SHARE[1]));
        let [x, y] = PLACE.map(|most| random.random_range(-most..most) * LONGER * depth / focal);
        Self {
            rotation,
            focal,
            place: [x, y, depth],
        }
    }

    /// The stance of `frame` before the camera; `origin` is where the person is in the middle of the window.
    pub(super) fn stance(&self, frame: &ClipFrame, origin: Vec3) -> Stance {
        let mut rotations = frame.rotations;
        rotations[0] = matmul(&self.rotation, &rotations[0]);
        Stance {
            rotations,
            root: add(self.place, matvec(&self.rotation, sub(frame.root, origin))),
        }
    }
}
