//! 3-vectors, rotations and rigid motions in double precision.
//!
//! Points and matrices are arrays, row by row, as captures and files have them; [`glam`] computes
//! with vectors and rotations. Rigid motions stay row by row: glam keeps columns, and its inverse is
//! that of any affine map.

use glam::{DMat3, DQuat, DVec3};

/// A point or direction, or an axis-angle rotation in radians.
pub type Vec3 = [f64; 3];
/// A rotation, row by row.
pub type Mat3 = [[f64; 3]; 3];
/// A rigid motion `[R | t]`, row by row.
pub type Mat34 = [[f64; 4]; 3];

/// The rotation by no angle.
pub const IDENTITY_ROTATION: Mat3 = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// The rigid motion that moves nothing.
pub const IDENTITY: Mat34 = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0],
];

/// Shortest vector that has a direction. Rounding decides the direction of a shorter one.
const SHORTEST: f64 = 1e-9;

/// `a + b`.
pub fn add(a: Vec3, b: Vec3) -> Vec3 {
    (DVec3::from(a) + DVec3::from(b)).into()
}

/// `a - b`.
pub fn sub(a: Vec3, b: Vec3) -> Vec3 {
    (DVec3::from(a) - DVec3::from(b)).into()
}

/// `a * s`.
pub fn scale(a: Vec3, s: f64) -> Vec3 {
    (DVec3::from(a) * s).into()
}

/// Scalar product.
pub fn dot(a: Vec3, b: Vec3) -> f64 {
    DVec3::from(a).dot(b.into())
}

/// Vector product.
pub fn cross(a: Vec3, b: Vec3) -> Vec3 {
    DVec3::from(a).cross(b.into()).into()
}

/// Euclidean length.
pub fn length(a: Vec3) -> f64 {
    DVec3::from(a).length()
}

/// `a` at length 1; a zero vector stays zero.
pub fn normalised(a: Vec3) -> Vec3 {
    DVec3::from(a).normalize_or_zero().into()
}

/// The rotation matrix of an axis-angle vector, by Rodrigues' formula: the exponential map of SO(3).
pub fn rodrigues(r: Vec3) -> Mat3 {
    matrix(DQuat::from_scaled_axis(r.into()))
}

/// The rotation matrix of a unit quaternion, real part first.
pub fn from_quaternion([w, x, y, z]: [f64; 4]) -> Mat3 {
    matrix(DQuat::from_xyzw(x, y, z, w))
}

/// The unit quaternion of a rotation matrix, real part first: the inverse of [`from_quaternion`].
pub fn to_quaternion(m: &Mat3) -> [f64; 4] {
    let q = DQuat::from_mat3(&DMat3::from_cols_array_2d(m).transpose());
    [q.w, q.x, q.y, q.z]
}

/// The axis-angle vector of a rotation matrix, with an angle from 0 to π: the inverse of [`rodrigues`].
pub fn log_map(m: &Mat3) -> Vec3 {
    shorter(DQuat::from_mat3(&DMat3::from_cols_array_2d(m).transpose()))
}

/// The axis-angle vector of the rotation by `first` and then by `then`, with an angle from 0 to π.
pub fn compose_axis_angle(then: Vec3, first: Vec3) -> Vec3 {
    let [then, first] = [then, first].map(|r| DQuat::from_scaled_axis(r.into()));
    shorter(then * first)
}

/// The shortest rotation from the direction of `from` to that of `to`. Between opposite directions it
/// is half a turn about any perpendicular axis. `None` if either vector has no direction.
pub fn rotation_between(from: Vec3, to: Vec3) -> Option<Mat3> {
    let direction = |v: Vec3| (length(v) > SHORTEST).then(|| DVec3::from(v).normalize());
    let (from, to) = (direction(from)?, direction(to)?);
    Some(matrix(DQuat::from_rotation_arc(from, to)))
}

/// The rotation matrix of `q`, row by row.
fn matrix(q: DQuat) -> Mat3 {
    DMat3::from_quat(q).transpose().to_cols_array_2d()
}

/// The axis-angle vector of `q`, with an angle from 0 to π.
fn shorter(q: DQuat) -> Vec3 {
    // `q` and `-q` are the same rotation; the one with w ≥ 0 has the angle of at most π.
    let q = if q.w < 0.0 { -q } else { q };
    q.to_scaled_axis().into()
}

/// The matrix product `a · b`: the rotation by `b` and then by `a`.
pub fn matmul(a: &Mat3, b: &Mat3) -> Mat3 {
    let b = transpose(b);
    a.map(|row| b.map(|column| dot(row, column)))
}

/// The transpose of `a`, which is the inverse of a rotation.
pub fn transpose(a: &Mat3) -> Mat3 {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

/// The matrix-vector product `a · v`: `v` rotated by `a`.
pub fn matvec(a: &Mat3, v: Vec3) -> Vec3 {
    a.map(|row| dot(row, v))
}

/// `[rotation | translation]`.
pub fn rigid(rotation: Mat3, translation: Vec3) -> Mat34 {
    std::array::from_fn(|i| {
        let [x, y, z] = rotation[i];
        [x, y, z, translation[i]]
    })
}

/// The motion `b` followed by `a`.
pub fn compose(a: &Mat34, b: &Mat34) -> Mat34 {
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let product: f64 = (0..3).map(|k| a[i][k] * b[k][j]).sum();
            product + if j == 3 { a[i][3] } else { 0.0 }
        })
    })
}

/// The inverse motion `[Rᵀ | -Rᵀ t]`, which is exact only where `R` is a rotation.
pub fn inverse(m: &Mat34) -> Mat34 {
    std::array::from_fn(|i| {
        let t: f64 = (0..3).map(|k| m[k][i] * m[k][3]).sum();
        [m[0][i], m[1][i], m[2][i], -t]
    })
}

/// A point moved by `m`.
pub fn apply(m: &Mat34, p: Vec3) -> Vec3 {
    std::array::from_fn(|i| m[i][0] * p[0] + m[i][1] * p[1] + m[i][2] * p[2] + m[i][3])
}

/// A direction rotated by `m`, without its translation.
pub fn rotate(m: &Mat34, v: Vec3) -> Vec3 {
    std::array::from_fn(|i| m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2])
}

/// The translation of `m`: the image of the origin.
pub fn position(m: &Mat34) -> Vec3 {
    std::array::from_fn(|i| m[i][3])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn quaternions_turn_as_their_matrices() {
        for r in [
            [0.3, -0.2, 0.5],
            [3.1, 0.0, 0.1],
            [0.0, 3.1, 0.1],
            [0.1, 0.0, 3.1],
            [0.0; 3],
        ] {
            let m = rodrigues(r);
            let back = from_quaternion(to_quaternion(&m));
            for (one, other) in m.as_flattened().iter().zip(back.as_flattened()) {
                assert!((one - other).abs() < 1e-9, "{r:?}");
            }
        }
    }

    #[test]
    fn logarithms_undo_rotations() {
        for rotation in [
            [0.0; 3],
            [1e-5, 0.0, -2e-5],
            [0.3, -0.8, 0.5],
            [-2.0, 1.0, 2.0],
            [0.0, 3.1, 0.0],
            [0.0, 0.0, -3.1],
            [PI - 1e-9, 0.0, 0.0],
            [0.0, 0.0, PI],
        ] {
            let found = log_map(&rodrigues(rotation));
            assert!(
                length(sub(found, rotation)) < 1e-9,
                "{rotation:?}: {found:?}"
            );
        }
        // Beyond half a turn, the logarithm is that of the shorter rotation.
        let found = log_map(&rodrigues([4.0, 0.0, 0.0]));
        assert!(length(sub(found, [4.0 - 2.0 * PI, 0.0, 0.0])) < 1e-12);
        // A turn too small for glam's logarithm is none.
        assert_eq!(log_map(&rodrigues([1e-9, 0.0, 0.0])), [0.0; 3]);
    }

    #[test]
    fn the_shortest_rotation_leads_from_one_direction_to_the_other() {
        for (from, to) in [
            ([1.0, 0.0, 0.0], [0.0, 2.0, 0.0]),
            ([0.0, 1.0, 0.0], [0.0, -1.0, 0.0]),
            ([3.0, 0.0, 0.0], [-1.0, 0.0, 0.0]),
            ([0.3, -0.2, 0.9], [0.3, -0.2, 0.9]),
            ([0.3, -0.2, 0.9], [-0.5, 1.4, 0.1]),
        ] {
            let found = rotation_between(from, to).expect("directions");
            let off = sub(matvec(&found, normalised(from)), normalised(to));
            assert!(length(off) < 1e-9, "{from:?} {to:?}");
            let angle = length(log_map(&found));
            let cosine = dot(normalised(from), normalised(to));
            assert!((angle.cos() - cosine).abs() < 1e-9, "{from:?} {to:?}");
        }
        assert_eq!(rotation_between([0.0; 3], [1.0, 0.0, 0.0]), None);
        assert_eq!(rotation_between([1.0, 0.0, 0.0], [0.0, 1e-12, 0.0]), None);
    }

    #[test]
    fn rotations_follow_each_other() {
        for (then, first) in [
            ([0.3, -0.2, 0.9], [1.2, 0.4, -0.7]),
            ([0.0, 3.0, 0.0], [0.0, 2.0, 0.0]),
            ([0.0; 3], [0.1, 0.0, 0.0]),
            ([1.0, 2.0, 3.0], [-1.0, -2.0, -3.0]),
        ] {
            let both = compose(
                &rigid(rodrigues(then), [0.0; 3]),
                &rigid(rodrigues(first), [0.0; 3]),
            );
            let one = rigid(rodrigues(compose_axis_angle(then, first)), [0.0; 3]);
            for probe in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.2, -0.4, 2.0]] {
                assert!(length(sub(apply(&both, probe), apply(&one, probe))) < 1e-12);
            }
        }
    }

    #[test]
    fn rotations_are_orthonormal_at_every_angle() {
        let axis = normalised([0.3, -0.8, 0.52]);
        for angle in [
            0.0,
            1e-12,
            1e-8,
            9.99e-4,
            1.01e-3,
            0.5,
            PI,
            2.0 * PI,
            7.0,
            1e3,
        ] {
            let r = rodrigues(scale(axis, angle));
            for i in 0..3 {
                for j in 0..3 {
                    let expected = if i == j { 1.0 } else { 0.0 };
                    assert!(
                        (dot(r[i], r[j]) - expected).abs() < 1e-12,
                        "{angle} rad: {r:?}"
                    );
                }
            }
            assert!((dot(cross(r[0], r[1]), r[2]) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn rotations_turn_the_right_way() {
        let quarter = rigid(rodrigues([0.0, PI / 2.0, 0.0]), [0.0; 3]);
        let turned = apply(&quarter, [0.0, 0.0, 1.0]);
        assert!(length(sub(turned, [1.0, 0.0, 0.0])) < 1e-15);
        let tiny = rodrigues([1e-8, 0.0, 0.0]);
        assert!((tiny[2][1] - 1e-8).abs() < 1e-20);
    }

    #[test]
    fn an_inverse_undoes_its_motion() {
        let m = rigid(rodrigues([0.4, -1.0, 2.0]), [1.0, 2.0, 3.0]);
        let there_and_back = compose(&inverse(&m), &m);
        for i in 0..3 {
            for j in 0..4 {
                assert!((there_and_back[i][j] - IDENTITY[i][j]).abs() < 1e-12);
            }
        }
    }
}
