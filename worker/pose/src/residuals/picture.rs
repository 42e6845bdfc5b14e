//! Residuals of key points in the picture.

use super::Rows;
use crate::forward::Posed;
use crate::joints::UNKNOWNS;
use crate::parameters::{FOCAL, Shared};
use crate::problem::{Observed, Problem};

/// Least depth of a point, metres.
const NEAREST: f64 = 0.1;
/// Errors of key points beyond this number of standard deviations are mistakes of the detector.
const BOUND: f64 = 4.0;

/// Adds two residuals per detection. A point behind the camera has an infinite cost, so that the search
/// never accepts a step there.
pub(crate) fn add(
    rows: &mut Rows,
    problem: &Problem,
    observed: &Observed,
    posed: &Posed,
    shared: &Shared,
) {
    let focal = shared.focal();
    for detection in &observed.detections {
        let Some(marker) = problem.markers.markers.get(detection.marker) else {
            continue;
        };
        let at = posed.marker(marker, shared);
        let [x, y, z] = at;
        if z < NEAREST {
            rows.cost = f64::INFINITY;
            return;
        }
        let weight = detection.precision * detection.confidence / problem.pixels;
        let off = [
            weight * (focal * x / z - detection.pixel[0]),
            weight * (focal * y / z - detection.pixel[1]),
        ];
        let factor = rows.robust(off[0] * off[0] + off[1] * off[1], BOUND);
        if !rows.has_slopes() {
            continue;
        }
        let slopes = posed.marker_slopes(marker, at, UNKNOWNS, rows.width);
        let (scaled, has_shared) = (factor * weight * focal / z, rows.has_shared());
        for axis in 0..2 {
            let share = at[axis] / z;
            rows.push(factor * off[axis], |row| {
                for (out, by) in row.iter_mut().zip(&slopes) {
                    *out = scaled * (by[axis] - share * by[2]);
                }
                if has_shared && let Some(out) = row.get_mut(UNKNOWNS + FOCAL) {
                    *out = scaled * at[axis];
                }
            });
        }
    }
}
