//! Plain 3-vectors, rotations and rigid motions in double precision.
//!
//! Kinematics, cameras and ray casting run on a handful of joints per frame: arrays serve
//! them better than a tensor or a linear-algebra dependency.

/// A point or direction.
pub type Vec3 = [f64; 3];
/// A rotation, row by row.
pub type Mat3 = [[f64; 3]; 3];
/// A rigid motion `[R | t]`, row by row.
pub type Mat34 = [[f64; 4]; 3];

/// No rotation, no translation.
pub const IDENTITY: Mat34 = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0],
];

/// `a + b`.
pub fn add(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// `a - b`.
pub fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `a * s`.
pub fn scale(a: Vec3, s: f64) -> Vec3 {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// Scalar product.
pub fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Vector product.
pub fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// Euclidean length.
pub fn length(a: Vec3) -> f64 {
    dot(a, a).sqrt()
}

/// `a` at length 1; a zero vector stays zero.
pub fn normalised(a: Vec3) -> Vec3 {
    let norm = length(a);
    if norm > 0.0 { scale(a, 1.0 / norm) } else { a }
}

/// The rotation of an axis-angle vector (radians): `I + A [r]x + B [r]x²` with
/// `A = sin θ / θ` and `B = (1 - cos θ) / θ²`, by their Taylor series under 1e-3 rad, so
/// that it is exact at 0 and orthonormal at any angle.
pub fn rodrigues(r: Vec3) -> Mat3 {
    let squared = dot(r, r);
    let (a, b) = if squared < 1e-6 {
        (
            1.0 - squared / 6.0 + squared * squared / 120.0,
            0.5 - squared / 24.0 + squared * squared / 720.0,
        )
    } else {
        let angle = squared.sqrt();
        // 1 - cos θ = 2 sin² (θ / 2) keeps its digits where θ is small.
        let half = (angle / 2.0).sin();
        (angle.sin() / angle, 2.0 * half * half / squared)
    };
    let [x, y, z] = r;
    [
        [
            1.0 - b * (y * y + z * z),
            b * x * y - a * z,
            b * x * z + a * y,
        ],
        [
            b * x * y + a * z,
            1.0 - b * (x * x + z * z),
            b * y * z - a * x,
        ],
        [
            b * x * z - a * y,
            b * y * z + a * x,
            1.0 - b * (x * x + y * y),
        ],
    ]
}

/// The axis-angle of the rotation by `first` and then by `then`, its angle from 0 to π; radians.
pub fn after(then: Vec3, first: Vec3) -> Vec3 {
    // (cos, axis sin) of half the angle.
    let quaternion = |v: Vec3| {
        let angle = length(v);
        let by = if angle < 1e-9 {
            0.5
        } else {
            (0.5 * angle).sin() / angle
        };
        ((0.5 * angle).cos(), scale(v, by))
    };
    let ((a, u), (b, v)) = (quaternion(then), quaternion(first));
    let (mut real, mut vector) = (
        a * b - dot(u, v),
        add(add(scale(v, a), scale(u, b)), cross(u, v)),
    );
    if real < 0.0 {
        (real, vector) = (-real, scale(vector, -1.0));
    }
    let sine = length(vector);
    if sine < 1e-12 {
        scale(vector, 2.0)
    } else {
        scale(vector, 2.0 * sine.atan2(real) / sine)
    }
}

/// `[rotation | translation]`.
pub fn rigid(rotation: Mat3, translation: Vec3) -> Mat34 {
    std::array::from_fn(|i| {
        let [x, y, z] = rotation[i];
        [x, y, z, translation[i]]
    })
}

/// First `b`, then `a`.
pub fn compose(a: &Mat34, b: &Mat34) -> Mat34 {
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let product: f64 = (0..3).map(|k| a[i][k] * b[k][j]).sum();
            product + if j == 3 { a[i][3] } else { 0.0 }
        })
    })
}

/// The motion that undoes `m`.
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

/// A direction turned by `m`; its translation plays no part.
pub fn rotate(m: &Mat34, v: Vec3) -> Vec3 {
    std::array::from_fn(|i| m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2])
}

/// Where `m` puts the origin.
pub fn position(m: &Mat34) -> Vec3 {
    std::array::from_fn(|i| m[i][3])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

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
            let one = rigid(rodrigues(after(then, first)), [0.0; 3]);
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
