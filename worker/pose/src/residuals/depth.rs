//! Residuals of bones' depths, as the network finds them. A picture hardly shows the lean of a whole body, so one lean for all frames is
//! unknown, as with a detector's points in space.

use super::Rows;
use crate::forward::Posed;
use crate::joints::UNKNOWNS;
use crate::parameters::{LEAN, Shared};
use crate::problem::{Observed, Problem};
use yoto_capture::skeleton::transform::sub;

/// Errors of depth beyond this number of standard deviations are mistakes.
const BOUND: f64 = 2.5;

/// Adds a residual per bone.
pub(crate) fn add(
    rows: &mut Rows,
    problem: &Problem,
    observed: &Observed,
    posed: &Posed,
    shared: &Shared,
) {
    let lean = shared.values.get(LEAN).copied().unwrap_or(0.0).sin();
    for found in &observed.depths {
        let [Some(from), Some(to)] = found
            .markers
            .map(|marker| problem.markers.markers.get(marker))
        else {
            continue;
        };
        let (a, b) = (posed.marker(from, shared), posed.marker(to, shared));
        let weight = 1.0 / found.spread;
        let height = b[1] - a[1];
        let off = weight * (b[2] - a[2] - found.depth - lean * height);
        let factor = rows.robust(off * off, BOUND);
        if !rows.has_slopes() {
            continue;
        }
        let (width, has_shared) = (rows.width, rows.has_shared());
        let ends = posed.marker_slopes(to, b, UNKNOWNS, width);
        let starts = posed.marker_slopes(from, a, UNKNOWNS, width);
        rows.push(factor * off, |row| {
            for ((out, end), start) in row.iter_mut().zip(&ends).zip(&starts) {
                let [_, down, away] = sub(*end, *start);
                *out = factor * weight * (away - lean * down);
            }
            if has_shared && let Some(out) = row.get_mut(UNKNOWNS + LEAN) {
                *out = -factor * weight * height * (1.0 - lean * lean).sqrt();
            }
        });
    }
}
