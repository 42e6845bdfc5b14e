//! Residuals of uprightness. People stand upright on average: their feet are below the head along gravity,
//! which all frames share.

use super::Rows;
use crate::forward::Posed;
use crate::joints::UNKNOWNS;
use crate::parameters::{DOWN, ROLL, Shared};
use yoto_capture::skeleton::Vec3;
use yoto_capture::skeleton::transform::{add as plus, dot, length, scale, sub};

/// Standard deviation of a body's lean in one frame, radians.
const SWAY: f64 = 0.15;
/// Largest lean of a standing body, in standard deviations.
const BOUND: f64 = 2.0;
const NECK: usize = 12;
const ANKLES: [usize; 2] = [7, 8];

/// The up direction in the axes of a camera with the pitch `down` and the roll `roll`, and its derivatives
/// by both.
pub(crate) fn up(down: f64, roll: f64) -> [Vec3; 3] {
    let ((s, c), (sr, cr)) = (down.sin_cos(), roll.sin_cos());
    [
        [c * sr, -c * cr, -s],
        [-s * sr, s * cr, -c],
        [c * cr, c * sr, 0.0],
    ]
}

/// The vector from the middle of the ankles to the neck.
pub(crate) fn body(posed: &Posed) -> Vec3 {
    let [left, right] = ANKLES.map(|ankle| posed.joints[ankle]);
    sub(posed.joints[NECK], scale(plus(left, right), 0.5))
}

/// Adds three residuals: the body's direction against gravity's.
pub(crate) fn add(rows: &mut Rows, posed: &Posed, shared: &Shared) {
    let way = body(posed);
    let distance = length(way).max(1e-6);
    let unit = scale(way, 1.0 / distance);
    let [wanted, by_down, by_roll] = up(shared.values[DOWN], shared.values[ROLL]);
    let off = scale(sub(unit, wanted), 1.0 / SWAY);
    let factor = rows.robust(dot(off, off), BOUND) / SWAY;
    if !rows.has_slopes() {
        return;
    }
    let (width, has_shared) = (rows.width, rows.has_shared());
    let slopes = |joint: usize| posed.slopes(joint, posed.joints[joint], UNKNOWNS, width);
    let (neck, [left, right]) = (slopes(NECK), ANKLES.map(slopes));
    let slopes_of_unit: Vec<Vec3> = neck
        .iter()
        .zip(left.iter().zip(&right))
        .map(|(top, (l, r))| {
            let by = sub(*top, scale(plus(*l, *r), 0.5));
            scale(sub(by, scale(unit, dot(unit, by))), factor / distance)
        })
        .collect();
    for axis in 0..3 {
        rows.push(factor * SWAY * off[axis], |row| {
            for (out, by) in row.iter_mut().zip(&slopes_of_unit) {
                *out = by[axis];
            }
            if has_shared {
                row[UNKNOWNS + DOWN] = -factor * by_down[axis];
                row[UNKNOWNS + ROLL] = -factor * by_roll[axis];
            }
        });
    }
}
