//! Rotations and rigid motions, for conversions between conventions.

/// A point or an axis-angle rotation.
pub(super) type Vec3 = [f64; 3];
/// A rotation, rows first.
pub(super) type Mat3 = [[f64; 3]; 3];

/// No rotation.
pub(super) const IDENTITY: Mat3 = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

pub(super) fn add(a: Vec3, b: Vec3) -> Vec3 {
    std::array::from_fn(|i| a[i] + b[i])
}

pub(super) fn sub(a: Vec3, b: Vec3) -> Vec3 {
    std::array::from_fn(|i| a[i] - b[i])
}

pub(super) fn scale(a: Vec3, by: f64) -> Vec3 {
    a.map(|v| v * by)
}

pub(super) fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// `m v`.
pub(super) fn apply(m: &Mat3, v: Vec3) -> Vec3 {
    m.map(|row| dot(row, v))
}

/// `a b`.
pub(super) fn mul(a: &Mat3, b: &Mat3) -> Mat3 {
    let b = transpose(b);
    a.map(|row| b.map(|column| dot(row, column)))
}

pub(super) fn transpose(m: &Mat3) -> Mat3 {
    std::array::from_fn(|i| std::array::from_fn(|j| m[j][i]))
}

/// The rotation of an axis-angle vector, radians.
pub(super) fn rotation(vector: Vec3) -> Mat3 {
    let angle = dot(vector, vector).sqrt();
    let (a, b) = if angle < 1e-6 {
        (1.0 - angle * angle / 6.0, 0.5 - angle * angle / 24.0)
    } else {
        (angle.sin() / angle, (1.0 - angle.cos()) / (angle * angle))
    };
    let [x, y, z] = vector;
    let k = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
    let kk = mul(&k, &k);
    std::array::from_fn(|i| std::array::from_fn(|j| IDENTITY[i][j] + a * k[i][j] + b * kk[i][j]))
}

/// The rotation by `angle` radians about the x, y or z axis (0, 1, 2).
pub(super) fn about_axis(axis: usize, angle: f64) -> Mat3 {
    let mut vector = [0.0; 3];
    if let Some(place) = vector.get_mut(axis) {
        *place = angle;
    }
    rotation(vector)
}

/// The axis-angle vector of a rotation, its angle from 0 to π. Computed from the
/// quaternion's largest component, so that half turns are exact as well.
pub(super) fn axis_angle(m: &Mat3) -> Vec3 {
    let trace = m[0][0] + m[1][1] + m[2][2];
    // 4 w², 4 x², 4 y², 4 z².
    let squares = [
        1.0 + trace,
        1.0 + 2.0 * m[0][0] - trace,
        1.0 + 2.0 * m[1][1] - trace,
        1.0 + 2.0 * m[2][2] - trace,
    ];
    let largest = (1..4).fold(
        0,
        |best, i| if squares[i] > squares[best] { i } else { best },
    );
    let root = squares[largest].max(0.0).sqrt();
    let by = 0.5 / root;
    let mut q = match largest {
        0 => [
            0.5 * root,
            (m[2][1] - m[1][2]) * by,
            (m[0][2] - m[2][0]) * by,
            (m[1][0] - m[0][1]) * by,
        ],
        1 => [
            (m[2][1] - m[1][2]) * by,
            0.5 * root,
            (m[0][1] + m[1][0]) * by,
            (m[0][2] + m[2][0]) * by,
        ],
        2 => [
            (m[0][2] - m[2][0]) * by,
            (m[0][1] + m[1][0]) * by,
            0.5 * root,
            (m[1][2] + m[2][1]) * by,
        ],
        _ => [
            (m[1][0] - m[0][1]) * by,
            (m[0][2] + m[2][0]) * by,
            (m[1][2] + m[2][1]) * by,
            0.5 * root,
        ],
    };
    if q[0] < 0.0 {
        q = q.map(|v| -v);
    }
    let vector = [q[1], q[2], q[3]];
    let sine = dot(vector, vector).sqrt();
    if sine < 1e-12 {
        return scale(vector, 2.0);
    }
    scale(vector, 2.0 * sine.atan2(q[0]) / sine)
}

/// The shortest rotation that takes the direction of `from` to that of `to`; half a turn about
/// some axis across where they are opposite. `None` where one of them has no direction.
pub(super) fn between(from: Vec3, to: Vec3) -> Option<Mat3> {
    let unit = |v: Vec3| {
        let length = dot(v, v).sqrt();
        (length > 1e-9).then(|| scale(v, 1.0 / length))
    };
    let (from, to) = (unit(from)?, unit(to)?);
    let axis = cross(from, to);
    let (sine, cosine) = (dot(axis, axis).sqrt(), dot(from, to));
    if sine > 1e-9 {
        return Some(rotation(scale(axis, sine.atan2(cosine) / sine)));
    }
    if cosine > 0.0 {
        return Some(IDENTITY);
    }
    let side = if from[0].abs() < 0.9 {
        [1.0, 0.0, 0.0]
    } else {
        [0.0, 1.0, 0.0]
    };
    let across = unit(cross(from, side))?;
    Some(rotation(scale(across, std::f64::consts::PI)))
}

/// A world-to-camera matrix of a rotation and a translation.
pub(super) fn extrinsics(r: &Mat3, t: Vec3) -> [[f64; 4]; 4] {
    let row = |i: usize| [r[i][0], r[i][1], r[i][2], t[i]];
    [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn axis_angles_come_back() {
        let near = |a: Vec3, b: Vec3| dot(sub(a, b), sub(a, b)).sqrt() < 1e-7;
        for vector in [
            [0.0; 3],
            [1e-9, 0.0, 0.0],
            [0.3, -0.2, 0.9],
            [0.0, 3.1, 0.0],
            [PI - 1e-9, 0.0, 0.0],
            [0.0, 0.0, PI],
            [1.2, -2.0, 1.7],
        ] {
            let found = axis_angle(&rotation(vector));
            assert!(near(found, vector), "{vector:?}: {found:?}");
        }
        // Beyond half a turn, the result is the shorter rotation.
        assert!(near(
            axis_angle(&rotation([4.0, 0.0, 0.0])),
            [4.0 - 2.0 * PI, 0.0, 0.0]
        ));
    }

    #[test]
    fn directions_are_turned_onto_each_other() {
        for (from, to) in [
            ([1.0, 0.0, 0.0], [0.0, 2.0, 0.0]),
            ([0.0, 1.0, 0.0], [0.0, -1.0, 0.0]),
            ([3.0, 0.0, 0.0], [-1.0, 0.0, 0.0]),
            ([0.2, 0.5, -0.1], [0.2, 0.5, -0.1]),
        ] {
            let turned = apply(&between(from, to).expect("directions"), from);
            let across = cross(turned, to);
            assert!(dot(across, across) < 1e-12 && dot(turned, to) > 0.0);
        }
        assert_eq!(between([0.0; 3], [1.0, 0.0, 0.0]), None);
    }
}
