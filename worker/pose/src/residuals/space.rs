//! Residuals of the directions between a detector's points in space.
//!
//! Directions don't depend on size, so they are valid whatever body size the detector assumes. A detector's
//! guess of a person's lean towards the camera is poor, so one lean for all frames is unknown. A detector of hands or faces alone has no
//! such lean.

use super::Rows;
use crate::forward::Posed;
use crate::joints::UNKNOWNS;
use crate::parameters::{LEAN, Shared};
use crate::problem::{Observed, Problem};
use crate::rotation::matvec;
use yoto_capture::skeleton::Vec3;
use yoto_capture::skeleton::transform::{cross, dot, length, rodrigues, scale, sub};

/// Errors of directions beyond this number of standard deviations are mistakes of the detector.
const BOUND: f64 = 2.5;
const X: Vec3 = [1.0, 0.0, 0.0];

/// Adds three residuals per direction.
pub(crate) fn add(
    rows: &mut Rows,
    problem: &Problem,
    observed: &Observed,
    posed: &Posed,
    shared: &Shared,
) {
    let angle = shared.values.get(LEAN).copied().unwrap_or(0.0);
    for direction in &observed.directions {
        let [Some(from), Some(to)] = direction
            .markers
            .map(|marker| problem.markers.markers.get(marker))
        else {
            continue;
        };
        let (a, b) = (posed.marker(from, shared), posed.marker(to, shared));
        let way = sub(b, a);
        let distance = length(way).max(1e-6);
        // The share of the lean in this direction.
        let share = if direction.is_close { 0.0 } else { 1.0 };
        let lean = rodrigues(scale(X, share * angle));
        let (unit, wanted) = (scale(way, 1.0 / distance), matvec(&lean, direction.towards));
        let weight = direction.length / direction.error;
        let off = scale(sub(unit, wanted), weight);
        let factor = rows.robust(dot(off, off), BOUND);
        if !rows.has_slopes() {
            continue;
        }
        let (width, has_shared) = (rows.width, rows.has_shared());
        let ends = posed.marker_slopes(to, b, UNKNOWNS, width);
        let starts = posed.marker_slopes(from, a, UNKNOWNS, width);
        let slopes_of_unit: Vec<Vec3> = ends
            .iter()
            .zip(&starts)
            .map(|(end, start)| {
                let by = sub(*end, *start);
                scale(
                    sub(by, scale(unit, dot(unit, by))),
                    factor * weight / distance,
                )
            })
            .collect();
        let leaning = scale(cross(X, wanted), share);
        for axis in 0..3 {
            rows.push(factor * off[axis], |row| {
                for (out, by) in row.iter_mut().zip(&slopes_of_unit) {
                    *out = by[axis];
                }
                if has_shared && let Some(out) = row.get_mut(UNKNOWNS + LEAN) {
                    *out = -factor * weight * leaning[axis];
                }
            });
        }
    }
}
