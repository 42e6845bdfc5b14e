//! Bodies have mass: joints and the root change their speed slowly.

use crate::joints::{ACTIVE, PLACE, habit_of};
use crate::parameters::Stance;
use crate::rotation::{log_map, log_map_derivative, matmul, transpose};
use yoto_capture::skeleton::Vec3;
use yoto_capture::skeleton::transform::{Mat3, dot, scale, sub};

/// The root's turning, rad/s².
const ROOT_TURN: f64 = 15.0;
/// The root's movement, m/s².
const ROOT_MOVE: f64 = 4.0;

/// How an acceleration's residual depends on three frames.
#[derive(Clone, Debug)]
pub(crate) struct Bend {
    /// The first of three unknowns in each frame.
    pub column: usize,
    pub value: Vec3,
    /// Derivatives by the three unknowns of the frame before, the frame itself and the one
    /// after.
    pub slopes: [Mat3; 3],
}

/// The accelerations at the middle one of three frames at `times` seconds: joints by standard
/// deviations of their habit, then the root's place.
pub(crate) fn bends(stances: [&Stance; 3], times: [f64; 3]) -> impl Iterator<Item = Bend> {
    let [before, now, after] = stances;
    let spans = [times[1] - times[0], times[2] - times[1]];
    let rate = 2.0 / (spans[0] + spans[1]);
    let turns = ACTIVE.into_iter().enumerate().map(move |(at, joint)| {
        let spread = if joint == 0 {
            ROOT_TURN
        } else {
            habit_of(joint).jerk
        };
        let turn = |a: &Stance, b: &Stance| {
            log_map(&matmul(
                &transpose(&a.rotations[joint]),
                &b.rotations[joint],
            ))
        };
        let (first, second) = (turn(before, now), turn(now, after));
        let (by_first, by_second) = (log_map_derivative(first), log_map_derivative(second));
        let (one, two) = (rate / spread / spans[0], rate / spread / spans[1]);
        Bend {
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
    let place = Bend {
        column: PLACE,
        value: sub(scale(second, two), scale(first, one)),
        slopes: [one, -one - two, two].map(|by| scaled(&crate::rotation::IDENTITY_ROTATION, by)),
    };
    turns.chain(std::iter::once(place))
}

/// What the accelerations at a frame cost.
pub(crate) fn cost(stances: [&Stance; 3], times: [f64; 3]) -> f64 {
    bends(stances, times)
        .map(|bend| dot(bend.value, bend.value))
        .sum()
}

fn scaled(m: &Mat3, by: f64) -> Mat3 {
    m.map(|row| scale(row, by))
}

fn sum(a: &Mat3, b: &Mat3) -> Mat3 {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][j] + b[i][j]))
}
