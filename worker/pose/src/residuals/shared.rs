//! Priors of body, camera and detector.

use crate::parameters::{ATTACHMENTS, DOWN, FLOOR, FOCAL, LEAN, ROLL, Shared};
use crate::problem::Problem;
use crate::skeleton::{GROUP_SPREAD, GROUPS};

/// Standard deviation of an unknown focal length's logarithm.
const FOCAL_SPREAD: f64 = 0.15;
/// Least and greatest focal length, as multiples of the longer side.
const FOCAL_RANGE: [f64; 2] = [0.6, 3.0];
/// Standard deviation of the logarithm beyond this range.
const FOCAL_STOP: f64 = 0.02;
/// Standard deviation of the lean of a detector's space, radians.
const LEAN_SPREAD: f64 = 0.2;
/// Standard deviation of the camera's pitch, radians.
const DOWN_SPREAD: f64 = 0.14;
/// Weight of the pitch's prior. Foreshortening shows the pitch only as far as the body's proportions are
/// average, and this error is the same in every frame, and more frames don't make it more certain
/// (docs/research/poses.md).
const TILT: f64 = 2.0;
/// Standard deviation of the camera's roll, radians.
const ROLL_SPREAD: f64 = 0.05;

/// Standard deviation of the floor's height, metres.
const FLOOR_SPREAD: f64 = 0.5;

/// Weight of the prior of markers' offsets. A detector's errors are similar in all frames and poses, so many
/// frames are not independent observations.
const BODY: f64 = 4.0;
/// Weight of the prior of bone lengths, for the same reason.
const LENGTHS: f64 = 2.0;

/// A residual of one shared unknown: the unknown's index, the residual, and its derivative.
pub(crate) type SharedRow = (usize, f64, f64);

/// The residuals of the shared unknowns; fixed ones have none.
pub(crate) fn rows(problem: &Problem, shared: &Shared) -> Vec<SharedRow> {
    let mut rows = Vec::new();
    let mut add = |at: usize, usual: f64, spread: f64| {
        rows.push((at, (shared.values[at] - usual) / spread, 1.0 / spread));
    };
    for (group, &spread) in GROUP_SPREAD.iter().enumerate().take(GROUPS) {
        add(group, 0.0, spread / LENGTHS);
    }
    add(LEAN, 0.0, LEAN_SPREAD);
    add(DOWN, 0.0, DOWN_SPREAD / TILT);
    add(ROLL, 0.0, ROLL_SPREAD);
    if let Some(floor) = problem.floor {
        add(FLOOR, floor, FLOOR_SPREAD);
    }
    for (attachment, known) in problem.markers.attachments.iter().enumerate() {
        for axis in 0..3 {
            if known.spread[axis] > 0.0 {
                let at = ATTACHMENTS + 3 * attachment + axis;
                add(at, known.offset[axis], known.spread[axis] / BODY);
            }
        }
    }
    if !problem.focal_known {
        add(FOCAL, problem.focal.ln(), FOCAL_SPREAD);
        let value = shared.values[FOCAL];
        let [least, most] = FOCAL_RANGE.map(|share| (share * problem.longer).ln());
        if value != value.clamp(least, most) {
            add(FOCAL, value.clamp(least, most), FOCAL_STOP);
        }
    }
    rows
}

/// For each shared unknown, whether it is fixed at its value.
pub(crate) fn held(problem: &Problem, unknowns: usize) -> Vec<bool> {
    let mut held = vec![false; unknowns];
    held[FOCAL] = problem.focal_known;
    held[FLOOR] = problem.floor.is_none();
    let spreads = problem
        .markers
        .attachments
        .iter()
        .flat_map(|attachment| attachment.spread);
    for (hold, spread) in held.iter_mut().skip(ATTACHMENTS).zip(spreads) {
        *hold = spread <= 0.0;
    }
    held
}
