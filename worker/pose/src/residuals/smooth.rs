//! Residuals of accelerations. Bodies have mass, so joints and the root change their speed slowly.

use crate::joints::{ACTIVE, ROOT_POSITION, habit_of};
use crate::parameters::Stance;
use crate::rotation::{log_map, log_map_derivative, matmul, transpose};
use yoto_capture::skeleton::Vec3;
use yoto_capture::skeleton::transform::{Mat3, dot, scale, sub};

/// Standard deviation of the root's angular acceleration, rad/s².
const ROOT_TURN: f64 = 15.0;
/// Standard deviation of the root's acceleration, m/s².
const ROOT_MOVE: f64 = 4.0;

/// The residual of an acceleration, and its dependence on three frames.
#[derive(Clone, Debug)]
pub(crate) struct Acceleration {
    /// The first of three unknowns in each frame.
    pub column: usize,
    pub value: Vec3,
    /// Derivatives by the three unknowns in the frame before, the frame itself and the frame after.
    pub slopes: [Mat3; 3],
}

/// The accelerations at the middle of three frames at `times` seconds, in standard deviations: those of the
/// joints' rotations, then that of the root's position.
pub(crate) fn accelerations(
    stances: [&Stance; 3],
    times: [f64; 3],
) -> impl Iterator<Item = Acceleration> {
    let [before, now, after] = stances;
    let spans = [times[1] - times[0], times[2] - times[1]];
    let rate = 2.0 / (spans[0] + spans[1]);
    let rotations = ACTIVE.into_iter().enumerate().map(move |(at, joint)| {
        let spread = if joint == 0 {
            ROOT_TURN
        } else {
            habit_of(joint).jerk
        };
        let rotation = |a: &Stance, b: &Stance| {
            log_map(&matmul(
                &transpose(&a.rotations[joint]),
                &b.rotations[joint],
            ))
        };
        let (first, second) = (rotation(before, now), rotation(now, after));
        let (by_first, by_second) = (log_map_derivative(first), log_map_derivative(second));
        let (one, two) = (rate / spread / spans[0], rate / spread / spans[1]);
        Acceleration {
            column: 3 * at,
            value: sub(scale(second, two), scale(first, one)),
            slopes: [
                scaled(&transpose(&by_first), one),
                sum(
                    &scaled(&transpose(&by_second), -two),
                    &scaled(&by_first, -one),
                ),
                scaled(&by_second, two),
            ],
        }
    });
    let (one, two) = (rate / ROOT_MOVE / spans[0], rate / ROOT_MOVE / spans[1]);
    let (first, second) = (sub(now.root, before.root), sub(after.root, now.root));
    let root = Acceleration {
        column: ROOT_POSITION,
        value: sub(scale(second, two), scale(first, one)),
        slopes: [one, -one - two, two].map(|by| scaled(&crate::rotation::IDENTITY_ROTATION, by)),
    };
    rotations.chain(std::iter::once(root))
}

/// The cost of the accelerations at a frame.
pub(crate) fn cost(stances: [&Stance; 3], times: [f64; 3]) -> f64 {
    accelerations(stances, times)
        .map(|acceleration| dot(acceleration.value, acceleration.value))
        .sum()
}

fn scaled(m: &Mat3, by: f64) -> Mat3 {
    m.map(|row| scale(row, by))
}

fn sum(a: &Mat3, b: &Mat3) -> Mat3 {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][j] + b[i][j]))
}
