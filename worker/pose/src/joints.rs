//! Priors of joint rotations: the usual rotation, its spread, and its limits.

use crate::skeleton::COUNT;
use yoto_capture::skeleton::Vec3;

/// Joints with a rotation that key points can show. The ends of the tree move no points.
pub(crate) const ACTIVE: [usize; 20] = [
    0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21,
];

/// Unknowns of a frame: three per rotation, then the root's position.
pub(crate) const UNKNOWNS: usize = 3 * ACTIVE.len() + 3;
/// The first unknown of the root's position.
pub(crate) const ROOT_POSITION: usize = 3 * ACTIVE.len();

/// The first of a joint's three unknowns.
pub(crate) const COLUMN: [Option<usize>; COUNT] = columns();

const fn columns() -> [Option<usize>; COUNT] {
    let mut found = [None; COUNT];
    let mut at = 0;
    while at < ACTIVE.len() {
        found[ACTIVE[at]] = Some(3 * at);
        at += 1;
    }
    found
}

/// The prior of a joint's axis-angle vector, radians, in the T-pose's axes: x is flexion, y is twist, z is
/// sideways.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Habit {
    pub usual: Vec3,
    /// Standard deviation.
    pub spread: Vec3,
    /// Soft limits, least and greatest.
    pub range: [[f64; 2]; 3],
    /// Standard deviation of the angular acceleration, rad/s².
    pub jerk: f64,
}

const FREE: [f64; 2] = [-9.0, 9.0];
const ANY: [[f64; 2]; 3] = [FREE; 3];

const fn habit(usual: Vec3, spread: Vec3, range: [[f64; 2]; 3], jerk: f64) -> Habit {
    Habit {
        usual,
        spread,
        range,
        jerk,
    }
}

/// The prior of a joint other than the root; right joints mirror left ones.
pub(crate) fn habit_of(joint: usize) -> Habit {
    let none = [0.0; 3];
    let left = match joint {
        1 | 2 => habit(
            [-0.15, 0.0, 0.05],
            [0.8, 0.35, 0.3],
            [[-2.4, 0.9], [-0.9, 0.9], [-0.7, 1.1]],
            40.0,
        ),
        4 | 5 => habit(
            [0.2, 0.0, 0.0],
            [0.9, 0.1, 0.08],
            [[-0.03, 2.7], FREE, FREE],
            40.0,
        ),
        7 | 8 => habit(none, [0.3, 0.2, 0.2], [[-0.9, 0.9], FREE, FREE], 40.0),
        3 | 6 | 9 => habit(none, [0.18, 0.15, 0.1], ANY, 10.0),
        12 => habit(none, [0.2, 0.25, 0.12], ANY, 20.0),
        15 => habit(none, [0.25, 0.45, 0.2], ANY, 20.0),
        13 | 14 => habit(none, [0.1, 0.12, 0.15], ANY, 15.0),
        16 | 17 => habit([0.0, 0.0, -0.9], [0.9, 0.9, 1.0], ANY, 40.0),
        18 | 19 => habit(
            [0.0, -0.4, 0.0],
            [0.4, 0.9, 0.3],
            [FREE, [-2.7, 0.03], FREE],
            50.0,
        ),
        _ => habit(none, [0.3, 0.25, 0.4], ANY, 50.0),
    };
    let right = matches!(joint, 2 | 5 | 8 | 14 | 17 | 19 | 21);
    if right { mirrored(left) } else { left }
}

/// The prior of the counterpart on the other side: rotations about y and z change sign.
fn mirrored(habit: Habit) -> Habit {
    let flip = |[least, most]: [f64; 2]| [-most, -least];
    let ([x, y, z], range) = (habit.usual, habit.range);
    Habit {
        usual: [x, -y, -z],
        range: [range[0], flip(range[1]), flip(range[2])],
        ..habit
    }
}
