//! Where key points appear in the picture.

use super::Rows;
use crate::forward::Posed;
use crate::joints::UNKNOWNS;
use crate::parameters::{FOCAL, Shared};
use crate::problem::{Observed, Problem};

/// Nearest place before the camera, metres.
const NEAREST: f64 = 0.1;
/// Errors of key points beyond this many standard deviations are mistakes.
const BOUND: f64 = 4.0;

/// Adds two residuals a seen point. A point behind the camera costs infinitely much.
pub(crate) fn add(
    rows: &mut Rows,
    problem: &Problem,
    observed: &Observed,
    posed: &Posed,
    shared: &Shared,
) {
    let focal = shared.focal();
    for seen in &observed.seen {
        let Some(marker) = problem.markers.markers.get(seen.marker) else {
            continue;
        };
        let at = posed.marker(marker, shared);
        let [x, y, z] = at;
        if z < NEAREST {
            rows.cost = f64::INFINITY;
            return;
        }
        let weight = seen.confidence / problem.pixels;
        let off = [
            weight * (focal * x / z - seen.at[0]),
            weight * (focal * y / z - seen.at[1]),
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
