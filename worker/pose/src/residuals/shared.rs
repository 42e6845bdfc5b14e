//! What is likely of bodies, cameras and detectors before any frame is seen.

use crate::parameters::{DOWN, FOCAL, LEAN, PLACES, ROLL, Shared};
use crate::problem::Problem;
use crate::skeleton::{GROUP_SPREAD, GROUPS};

/// Standard deviation of an unknown focal length's logarithm.
const FOCAL_SPREAD: f64 = 0.15;
/// Least and most focal length by the longer side.
const FOCAL_RANGE: [f64; 2] = [0.6, 3.0];
/// Standard deviation of the logarithm beyond them.
const FOCAL_STOP: f64 = 0.02;
/// How far a detector's space leans, radians.
const LEAN_SPREAD: f64 = 0.2;
/// How far cameras look up or down, radians.
const DOWN_SPREAD: f64 = 0.14;
/// Weight of what is likely of tilts: how a body foreshortens tells them only as far as its
/// proportions are average, in every frame alike.
const TILT: f64 = 16.0;
/// How far cameras are turned about their line of sight, radians.
const ROLL_SPREAD: f64 = 0.05;

/// Weight of what is likely of markers' places. Errors of detectors are much the same from frame to frame
/// and from pose to pose: many frames are not as many witnesses.
const BODY: f64 = 4.0;
/// As [`BODY`], of lengths.
const LENGTHS: f64 = 2.0;

/// A residual of one shared unknown: which, its value, and its derivative by that unknown.
pub(crate) type SharedRow = (usize, f64, f64);

/// The residuals of `shared`; unknowns that are held have none.
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
    for (place, known) in problem.markers.places.iter().enumerate() {
        for axis in 0..3 {
            if known.spread[axis] > 0.0 {
                let at = PLACES + 3 * place + axis;
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

/// Whether each shared unknown is held at its value.
pub(crate) fn held(problem: &Problem, unknowns: usize) -> Vec<bool> {
    let mut held = vec![false; unknowns];
    held[FOCAL] = problem.focal_known;
    let spreads = problem.markers.places.iter().flat_map(|place| place.spread);
    for (hold, spread) in held.iter_mut().skip(PLACES).zip(spreads) {
        *hold = spread <= 0.0;
    }
    held
}
