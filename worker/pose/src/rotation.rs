//! Rotations as matrices, and their logarithms with derivatives.
//!
//! The fit changes a rotation by a small turn on its right, `R exp(δ)`; the derivatives here are
//! by that δ.

use yoto_capture::skeleton::Vec3;
use yoto_capture::skeleton::transform::{Mat3, cross, dot, length, normalised, rodrigues, scale};

/// No rotation.
pub(crate) const UNTURNED: Mat3 = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// First `b`, then `a`.
pub(crate) fn product(a: &Mat3, b: &Mat3) -> Mat3 {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

/// The rotation that undoes `a`.
pub(crate) fn transposed(a: &Mat3) -> Mat3 {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

/// `v` turned by `a`.
pub(crate) fn turned(a: &Mat3, v: Vec3) -> Vec3 {
    std::array::from_fn(|i| dot(a[i], v))
}

/// `v` turned back by `a`.
pub(crate) fn unturned(a: &Mat3, v: Vec3) -> Vec3 {
    std::array::from_fn(|j| (0..3).map(|i| a[i][j] * v[i]).sum())
}

/// A column of `a`: where it turns an axis to.
pub(crate) fn column(a: &Mat3, axis: usize) -> Vec3 {
    std::array::from_fn(|i| a[i][axis])
}

/// The matrix with these columns.
pub(crate) fn from_columns(columns: [Vec3; 3]) -> Mat3 {
    transposed(&columns)
}

/// The axis-angle of a rotation, radians; its length is 0 to π.
pub(crate) fn logarithm(m: &Mat3) -> Vec3 {
    let trace = m[0][0] + m[1][1] + m[2][2];
    // Of the four forms of the quaternion, the one whose divisor is largest.
    let squares = [trace, m[0][0], m[1][1], m[2][2]];
    let largest = (1..4).fold(
        0,
        |best, i| if squares[i] > squares[best] { i } else { best },
    );
    let skew = [m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]];
    let (mut real, mut vector) = if largest == 0 {
        let double = (1.0 + trace).max(0.0).sqrt();
        (0.5 * double, scale(skew, 0.5 / double))
    } else {
        let i = largest - 1;
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let double = (1.0 + m[i][i] - m[j][j] - m[k][k]).max(0.0).sqrt();
        let mut vector = [0.0; 3];
        vector[i] = 0.5 * double;
        vector[j] = 0.5 * (m[i][j] + m[j][i]) / double;
        vector[k] = 0.5 * (m[i][k] + m[k][i]) / double;
        (0.5 * skew[i] / double, vector)
    };
    if real < 0.0 {
        (real, vector) = (-real, scale(vector, -1.0));
    }
    let sine = length(vector);
    if sine < 1e-9 {
        return scale(vector, 2.0);
    }
    scale(vector, 2.0 * sine.atan2(real) / sine)
}

/// The derivative of `logarithm(R exp(δ))` by δ at 0, where `r` is the logarithm of R. Its
/// transpose is the derivative for `exp(δ) R`.
pub(crate) fn logarithm_derivative(r: Vec3) -> Mat3 {
    let angle = length(r);
    let square = if angle < 1e-3 {
        1.0 / 12.0
    } else {
        1.0 / (angle * angle) - (1.0 + angle.cos()) / (2.0 * angle * angle.sin().max(1e-6))
    };
    let [x, y, z] = r;
    let skew = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
    let squared = product(&skew, &skew);
    std::array::from_fn(|i| {
        std::array::from_fn(|j| UNTURNED[i][j] + 0.5 * skew[i][j] + square * squared[i][j])
    })
}

/// The shortest rotation from the direction `from` to `to`; none where either has no length.
pub(crate) fn between(from: Vec3, to: Vec3) -> Mat3 {
    let (a, b) = (normalised(from), normalised(to));
    let (axis, cosine) = (cross(a, b), dot(a, b));
    let sine = length(axis);
    if sine > 1e-9 {
        return rodrigues(scale(axis, sine.atan2(cosine) / sine));
    }
    if cosine >= 0.0 {
        return UNTURNED;
    }
    // Half a turn about any axis across.
    let across = if a[0].abs() < 0.9 {
        [1.0, 0.0, 0.0]
    } else {
        [0.0, 1.0, 0.0]
    };
    rodrigues(scale(normalised(cross(a, across)), std::f64::consts::PI))
}

/// The rotation whose x axis is near `x` and whose y axis is `y`, as far as both have a direction.
pub(crate) fn from_axes(x: Vec3, y: Vec3) -> Option<Mat3> {
    let up = normalised(y);
    let forward = cross(x, up);
    if length(forward) < 1e-3 * length(x) || length(forward) < 1e-9 || length(up) < 0.5 {
        return None;
    }
    let forward = normalised(forward);
    Some(from_columns([cross(up, forward), up, forward]))
}

/// The turn `share` of the way from `a` to `b`.
pub(crate) fn mixed(a: &Mat3, b: &Mat3, share: f64) -> Mat3 {
    let turn = logarithm(&product(&transposed(a), b));
    product(a, &rodrigues(scale(turn, share)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_capture::skeleton::transform::sub;

    const TURNS: [Vec3; 6] = [
        [0.3, -0.8, 0.5],
        [1e-5, 0.0, -2e-5],
        [0.0, 3.1, 0.0],
        [-2.0, 1.0, 2.0],
        [0.0, 0.0, -3.1],
        [0.0; 3],
    ];

    #[test]
    fn logarithms_undo_rotations() {
        for turn in TURNS {
            let found = logarithm(&rodrigues(turn));
            assert!(length(sub(found, turn)) < 1e-9, "{turn:?} {found:?}");
        }
    }

    #[test]
    fn derivatives_of_logarithms_agree_with_differences() {
        for turn in TURNS {
            let exact = logarithm_derivative(turn);
            for axis in 0..3 {
                let step = |by: f64| {
                    let mut small = [0.0; 3];
                    small[axis] = by;
                    logarithm(&product(&rodrigues(turn), &rodrigues(small)))
                };
                let slope = scale(sub(step(1e-5), step(-1e-5)), 0.5e5);
                let off = length(sub(slope, column(&exact, axis)));
                assert!(off < 1e-5, "{turn:?} axis {axis}: {slope:?} {exact:?}");
            }
        }
    }

    #[test]
    fn the_shortest_turn_leads_from_one_direction_to_the_other() {
        for (from, to) in [
            ([1.0, 0.0, 0.0], [0.0, 2.0, 0.0]),
            ([1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]),
            ([0.3, -0.2, 0.9], [0.3, -0.2, 0.9]),
        ] {
            let found = turned(&between(from, to), normalised(from));
            assert!(length(sub(found, normalised(to))) < 1e-9, "{from:?} {to:?}");
        }
    }
}
