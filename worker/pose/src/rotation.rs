//! Derivatives of the logarithmic map, and rotations from axes.
//!
//! The fit changes a rotation by a small rotation on its right, `R exp(δ)`. The derivatives here are by that
//! δ.

pub(crate) use yoto_capture::skeleton::transform::{
    IDENTITY_ROTATION, log_map, matmul, matvec, transpose,
};

use yoto_capture::skeleton::Vec3;
use yoto_capture::skeleton::transform::{self, Mat3, cross, length, normalised, rodrigues, scale};

/// The product `aᵀ · v`: `v` rotated by the inverse of `a`.
pub(crate) fn transpose_matvec(a: &Mat3, v: Vec3) -> Vec3 {
    std::array::from_fn(|j| (0..3).map(|i| a[i][j] * v[i]).sum())
}

/// A column of `a`: the image of an axis.
pub(crate) fn column(a: &Mat3, axis: usize) -> Vec3 {
    std::array::from_fn(|i| a[i][axis])
}

/// The matrix with these columns.
pub(crate) fn from_columns(columns: [Vec3; 3]) -> Mat3 {
    transpose(&columns)
}

/// The derivative of `log(R exp(δ))` by δ at 0, where `r` = log R: the inverse right Jacobian of SO(3),
/// `I + [r]/2 + (1/θ² - (1 + cos θ) / (2 θ sin θ)) [r]²`. Its transpose is the derivative for `exp(δ) R`.
pub(crate) fn log_map_derivative(r: Vec3) -> Mat3 {
    let angle = length(r);
    // The factor of [r]² by its limit near 0, where it is a difference of two large numbers; near π the
    // denominator is kept from 0.
    let square = if angle < 1e-3 {
        1.0 / 12.0
    } else {
        1.0 / (angle * angle) - (1.0 + angle.cos()) / (2.0 * angle * angle.sin().max(1e-6))
    };
    let [x, y, z] = r;
    let skew = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
    let squared = matmul(&skew, &skew);
    std::array::from_fn(|i| {
        std::array::from_fn(|j| IDENTITY_ROTATION[i][j] + 0.5 * skew[i][j] + square * squared[i][j])
    })
}

/// The shortest rotation from the direction `from` to `to`; the identity if either has no length.
pub(crate) fn rotation_between(from: Vec3, to: Vec3) -> Mat3 {
    transform::rotation_between(from, to).unwrap_or(IDENTITY_ROTATION)
}

/// The rotation with the y axis along `y` and the x axis as near to `x` as possible; `None` if they don't
/// define one.
pub(crate) fn from_axes(x: Vec3, y: Vec3) -> Option<Mat3> {
    let up = normalised(y);
    let forward = cross(x, up);
    if length(forward) < 1e-3 * length(x) || length(forward) < 1e-9 || length(up) < 0.5 {
        return None;
    }
    let forward = normalised(forward);
    Some(from_columns([cross(up, forward), up, forward]))
}

/// Spherical interpolation from `a` (`share` 0) to `b` (`share` 1).
pub(crate) fn slerp(a: &Mat3, b: &Mat3, share: f64) -> Mat3 {
    let rotation = log_map(&matmul(&transpose(a), b));
    matmul(a, &rodrigues(scale(rotation, share)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_capture::skeleton::transform::sub;

    const ROTATIONS: [Vec3; 6] = [
        [0.3, -0.8, 0.5],
        [1e-5, 0.0, -2e-5],
        [0.0, 3.1, 0.0],
        [-2.0, 1.0, 2.0],
        [0.0, 0.0, -3.1],
        [0.0; 3],
    ];

    #[test]
    fn derivatives_of_logarithms_agree_with_differences() {
        for rotation in ROTATIONS {
            let exact = log_map_derivative(rotation);
            for axis in 0..3 {
                let step = |by: f64| {
                    let mut small = [0.0; 3];
                    small[axis] = by;
                    log_map(&matmul(&rodrigues(rotation), &rodrigues(small)))
                };
                let slope = scale(sub(step(1e-5), step(-1e-5)), 0.5e5);
                let off = length(sub(slope, column(&exact, axis)));
                assert!(off < 1e-5, "{rotation:?} axis {axis}: {slope:?} {exact:?}");
            }
        }
    }
}
