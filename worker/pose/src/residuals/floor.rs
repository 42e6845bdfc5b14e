//! Residuals of feet on a floor, which all frames share: a foot that stands still stands on it, and no foot is below it. A point of the
//! floor is higher in the picture the farther away it is, so the floor tells the depths of feet, which a detector hardly knows
//! (docs/research/poses.md).

use super::Rows;
use super::upright::up;
use crate::forward::Posed;
use crate::joints::UNKNOWNS;
use crate::parameters::{DOWN, FLOOR, ROLL, Shared, Stance};
use crate::problem::{Observed, Problem, quantile};
use yoto_capture::skeleton::transform::dot;

/// Height of the points of a sole above the floor, metres.
pub(crate) const ABOVE: f64 = 0.025;
/// Standard deviations of the heights of soles that stand, and of those below the floor, metres.
const STANDING: f64 = 0.03;
const BELOW: f64 = 0.02;
/// Heights beyond this number of standard deviations are of feet that are held still in the air, or on a step.
const BOUND: f64 = 3.0;

/// Adds a residual for each point of a sole that stands still or is below the floor.
pub(crate) fn add(
    rows: &mut Rows,
    problem: &Problem,
    observed: &Observed,
    posed: &Posed,
    shared: &Shared,
) {
    if problem.floor.is_none() {
        return;
    }
    let [way, by_down, by_roll] = up(shared.values[DOWN], shared.values[ROLL]);
    for &sole in &problem.markers.soles {
        let Some(marker) = problem.markers.markers.get(sole) else {
            continue;
        };
        let at = posed.marker(marker, shared);
        let height = dot(way, at) - shared.values[FLOOR] - ABOVE;
        let stands = observed.still.get(sole).copied().unwrap_or(false);
        let deviation = match (stands, height < 0.0) {
            (true, _) => STANDING,
            (false, true) => BELOW,
            (false, false) => continue,
        };
        let off = height / deviation;
        let factor = rows.robust(off * off, BOUND);
        if !rows.has_slopes() {
            continue;
        }
        let slopes = posed.marker_slopes(marker, at, UNKNOWNS, rows.width);
        let (scaled, has_shared) = (factor / deviation, rows.has_shared());
        rows.push(factor * off, |row| {
            for (out, by) in row.iter_mut().zip(&slopes) {
                *out = scaled * dot(way, *by);
            }
            if has_shared {
                row[UNKNOWNS + DOWN] = scaled * dot(by_down, at);
                row[UNKNOWNS + ROLL] = scaled * dot(by_roll, at);
                row[UNKNOWNS + FLOOR] = -scaled;
            }
        });
    }
}

/// The height above the camera at which the lowest sole is in most of the `stances`, metres; `None` if the points have no soles, or if
/// nothing is known of gravity.
pub(crate) fn height(problem: &Problem, stances: &[Stance], shared: &Shared) -> Option<f64> {
    let [way, ..] = up(shared.values[DOWN], shared.values[ROLL]);
    let lowest = |stance: &Stance| {
        let posed = Posed::new(stance, shared);
        let soles = problem.markers.soles.iter();
        let soles = soles.filter_map(|sole| problem.markers.markers.get(*sole));
        let heights = soles.map(|marker| dot(way, posed.marker(marker, shared)));
        heights.fold(f64::INFINITY, f64::min)
    };
    let mut heights: Vec<f64> = stances
        .iter()
        .map(lowest)
        .filter(|it| it.is_finite())
        .collect();
    let known = problem.upright && !heights.is_empty();
    known.then(|| quantile(&mut heights, 0.5) - ABOVE)
}
