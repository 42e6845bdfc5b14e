//! View-dependent colours of splats that bones rotate.

use std::f64::consts::PI;
use yoto_capture::skeleton::transform::Mat3;
use yoto_ops::splat::harmonics::{HARMONICS, terms};

/// The golden ratio, which gives an icosahedron's corners.
const GOLDEN: f64 = 1.618_033_988_749_895;

/// Coefficients of spherical harmonics by channel.
pub(crate) type Harmonics = [[f32; 3]; HARMONICS];

/// The view-dependent part of a colour for a camera that looks along `direction` in the rest pose. The direction may have
/// any length except 0.
pub(crate) fn gained(own: &Harmonics, direction: [f64; 3]) -> [f32; 3] {
    let length = direction.iter().map(|v| v * v).sum::<f64>().sqrt();
    let terms = terms(direction.map(|v| (v / length.max(f64::MIN_POSITIVE)) as f32));
    let along = |c: usize| own.iter().zip(&terms).map(move |(own, term)| own[c] * term);
    std::array::from_fn(|c| along(c).sum())
}

/// The coefficients after the rotation `by`: projections of the rotated colours onto each harmonic, as means over the
/// corners of an icosahedron, which are exact for these degrees. A rotation with shear gives the nearest coefficients.
pub(crate) fn rotated(own: &Harmonics, by: &Mat3) -> Harmonics {
    let mut rotated = [[0.0; 3]; HARMONICS];
    if own.as_flattened().iter().all(|value| *value == 0.0) {
        return rotated;
    }
    let corners = corners();
    for corner in &corners {
        let back = std::array::from_fn(|c| (0..3).map(|r| by[r][c] * corner[r]).sum());
        let gained = gained(own, back);
        for (sums, term) in rotated.iter_mut().zip(terms(corner.map(|v| v as f32))) {
            for (sum, gained) in sums.iter_mut().zip(gained) {
                *sum += (4.0 * PI / corners.len() as f64) as f32 * term * gained;
            }
        }
    }
    rotated
}

/// The corners of an icosahedron, unit vectors.
fn corners() -> [[f64; 3]; 12] {
    let length = (1.0 + GOLDEN * GOLDEN).sqrt();
    std::array::from_fn(|i| {
        let sign = |bit: usize| if i & bit == 0 { 1.0 } else { -1.0 };
        let mut corner = [0.0, sign(1) / length, sign(2) * GOLDEN / length];
        corner.rotate_left(i / 4);
        corner
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_capture::skeleton::transform::rodrigues;

    #[test]
    fn turned_harmonics_gain_what_they_did() {
        let own: Harmonics =
            std::array::from_fn(|k| std::array::from_fn(|c| ((3 * k + c) as f32 * 0.7).sin()));
        let by = rodrigues([0.4, -1.1, 0.6]);
        let rotated = rotated(&own, &by);
        for direction in [[0.3, 0.2, -0.9], [-1.0, 0.1, 0.4], [0.0, -1.0, 0.0]] {
            let moved = std::array::from_fn(|r| (0..3).map(|c| by[r][c] * direction[c]).sum());
            let (wanted, found) = (gained(&own, direction), gained(&rotated, moved));
            for c in 0..3 {
                assert!((wanted[c] - found[c]).abs() < 1e-5, "{wanted:?} {found:?}");
            }
        }
    }
}
