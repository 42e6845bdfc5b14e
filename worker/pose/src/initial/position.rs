//! A stance's position in front of the camera, from its key points in the picture.

use crate::forward::Posed;
use crate::parameters::{Shared, Stance};
use crate::problem::{Observed, Problem};
use crate::skeleton::{COUNT, height, offsets};
use faer::prelude::Solve;
use faer::{Mat, Side};
use yoto_capture::skeleton::Vec3;
use yoto_capture::skeleton::transform::Mat3;

/// Least distance of the root from the camera, metres.
const NEAREST: f64 = 0.6;

/// The stance with `rotations` at the position that brings its points closest to the detections.
///
/// With known rotations, the projection `f (x + tx) / (z + tz) = u` is linear in the position t, so this is
/// a linear least-squares problem.
pub(crate) fn positioned(
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
    for detection in &observed.detections {
        let Some(marker) = problem.markers.markers.get(detection.marker) else {
            continue;
        };
        let at = posed.marker(marker, shared);
        for axis in 0..2 {
            let mut row = [0.0, 0.0, -detection.pixel[axis]];
            row[axis] = focal;
            let value = detection.pixel[axis] * at[2] - focal * at[axis];
            for (i, by) in row.iter().enumerate() {
                right[(i, 0)] += detection.confidence * by * value;
                for (j, other) in row.iter().enumerate() {
                    squared[(i, j)] += detection.confidence * by * other;
                }
            }
        }
    }
    let solved = squared.llt(Side::Lower).ok().map(|factor| {
        factor.solve_in_place(right.as_mut());
        let root: Vec3 = std::array::from_fn(|axis| right[(axis, 0)]);
        root
    });
    // Few or contradictory points can put the solution behind the camera.
    let sound = |root: &Vec3| root.iter().all(|value| value.is_finite()) && root[2] > NEAREST;
    stance.root = solved
        .filter(sound)
        .unwrap_or_else(|| by_size(observed, shared));
    stance
}

/// The position at which a standing body is as large as the person in the picture.
fn by_size(observed: &Observed, shared: &Shared) -> Vec3 {
    let tall = height(&offsets(&shared.factors()));
    let far = (shared.focal() * tall / observed.extent).max(NEAREST);
    let count = observed.detections.len().max(1) as f64;
    let middle = |axis: usize| {
        observed
            .detections
            .iter()
            .map(|detection| detection.pixel[axis])
            .sum::<f64>()
            / count
    };
    [
        middle(0) * far / shared.focal(),
        middle(1) * far / shared.focal(),
        far,
    ]
}
