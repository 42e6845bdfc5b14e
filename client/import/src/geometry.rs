//! Rotations and rigid motions, for conversions between conventions.

pub(crate) use yoto_capture::skeleton::transform::{
    IDENTITY_ROTATION, Mat3, Vec3, add, cross, dot, log_map, matmul, matvec, rodrigues,
    rotation_between, scale, sub, transpose,
};

/// The rotation by `angle` radians about the x, y or z axis (0, 1, 2).
pub(crate) fn about_axis(axis: usize, angle: f64) -> Mat3 {
    let mut vector = [0.0; 3];
    if let Some(component) = vector.get_mut(axis) {
        *component = angle;
    }
    rodrigues(vector)
}

/// A world-to-camera matrix of a rotation and a translation.
pub(crate) fn extrinsics(r: &Mat3, t: Vec3) -> [[f64; 4]; 4] {
    let row = |i: usize| [r[i][0], r[i][1], r[i][2], t[i]];
    [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
}

/// Tolerance of the entries of a rotation matrix: files hold 32-bit floats.
const INEXACT: f64 = 1e-3;

/// The exact rotation of `matrix`, whose entries only approach it; `None` if it is not a rotation.
pub(crate) fn exact_rotation(matrix: &Mat3) -> Option<Mat3> {
    let product = matmul(matrix, &transpose(matrix));
    let off = product
        .as_flattened()
        .iter()
        .zip(IDENTITY_ROTATION.as_flattened());
    let off = off.fold(0.0f64, |most, (a, b)| most.max((a - b).abs()));
    let is_mirror = dot(cross(matrix[0], matrix[1]), matrix[2]) < 0.0;
    (off <= INEXACT && !is_mirror).then(|| rodrigues(log_map(matrix)))
}
