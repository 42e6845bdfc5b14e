//! A stance's place before the camera, from where its points appear.

use crate::forward::Posed;
use crate::parameters::{Shared, Stance};
use crate::problem::{Observed, Problem};
use crate::skeleton::{COUNT, height, offsets};
use faer::prelude::Solve;
use faer::{Mat, Side};
use yoto_capture::skeleton::Vec3;
use yoto_capture::skeleton::transform::Mat3;

/// Nearest place of the root, metres.
const NEAREST: f64 = 0.6;

/// The stance with `rotations` where its points appear nearest to where they are seen.
///
/// With rotations known the projection `f (x + tx) / (z + tz) = u` is linear in the place t.
pub(crate) fn placed(
    problem: &Problem,
    observed: &Observed,
    shared: &Shared,
    rotations: [Mat3; COUNT],
) -> Stance {
    let mut stance = Stance {
        rotations,
        root: [0.0; 3],
    };
    let posed = Posed::new(&stance, shared);
    let focal = shared.focal();
    let (mut squared, mut right) = (Mat::<f64>::zeros(3, 3), Mat::<f64>::zeros(3, 1));
    for seen in &observed.seen {
        let Some(marker) = problem.markers.markers.get(seen.marker) else {
            continue;
        };
        let at = posed.marker(marker, shared);
        for axis in 0..2 {
            let mut row = [0.0, 0.0, -seen.at[axis]];
            row[axis] = focal;
            let value = seen.at[axis] * at[2] - focal * at[axis];
            for (i, by) in row.iter().enumerate() {
                right[(i, 0)] += seen.confidence * by * value;
                for (j, other) in row.iter().enumerate() {
                    squared[(i, j)] += seen.confidence * by * other;
                }
            }
        }
    }
    let solved = squared.llt(Side::Lower).ok().map(|factor| {
        factor.solve_in_place(right.as_mut());
        let root: Vec3 = std::array::from_fn(|axis| right[(axis, 0)]);
        root
    });
    let sound = |root: &Vec3| root.iter().all(|value| value.is_finite()) && root[2] > NEAREST;
    stance.root = solved
        .filter(sound)
        .unwrap_or_else(|| by_size(observed, shared));
    stance
}

/// A place whose distance makes a standing body as large as it is seen.
fn by_size(observed: &Observed, shared: &Shared) -> Vec3 {
    let tall = height(&offsets(&shared.factors()));
    let far = (shared.focal() * tall / observed.extent).max(NEAREST);
    let count = observed.seen.len().max(1) as f64;
    let middle = |axis: usize| observed.seen.iter().map(|seen| seen.at[axis]).sum::<f64>() / count;
    [
        middle(0) * far / shared.focal(),
        middle(1) * far / shared.focal(),
        far,
    ]
}
