//! Inside a kernel: vectors and matrices of three numbers.

use cubecl::prelude::*;

#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
pub(super) struct Vec3 {
    pub x: f32,
    pub y: f32,
    pub z: f32,
}

/// The rows of a matrix.
#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
pub(super) struct Mat3 {
    pub x: Vec3,
    pub y: Vec3,
    pub z: Vec3,
}

/// Reads three numbers from the index `at`.
#[cube]
pub(super) fn read(values: &[f32], at: usize) -> Vec3 {
    Vec3 {
        x: values[at],
        y: values[at + 1],
        z: values[at + 2],
    }
}

/// Reads three rows from the index `at`; each begins `stride` numbers after the one before.
#[cube]
pub(super) fn read_rows(values: &[f32], at: usize, stride: usize) -> Mat3 {
    Mat3 {
        x: read(values, at),
        y: read(values, at + stride),
        z: read(values, at + 2 * stride),
    }
}

#[cube]
pub(super) fn write(values: &mut [f32], at: usize, v: &Vec3) {
    values[at] = v.x;
    values[at + 1] = v.y;
    values[at + 2] = v.z;
}

#[cube]
pub(super) fn dot(a: &Vec3, b: &Vec3) -> f32 {
    a.x * b.x + a.y * b.y + a.z * b.z
}

#[cube]
pub(super) fn plus(a: &Vec3, b: &Vec3) -> Vec3 {
    Vec3 {
        x: a.x + b.x,
        y: a.y + b.y,
        z: a.z + b.z,
    }
}

#[cube]
pub(super) fn scaled(a: &Vec3, by: f32) -> Vec3 {
    Vec3 {
        x: a.x * by,
        y: a.y * by,
        z: a.z * by,
    }
}

/// a m + b n.
#[cube]
pub(super) fn linear_combination(a: f32, m: &Vec3, b: f32, n: &Vec3) -> Vec3 {
    Vec3 {
        x: a * m.x + b * n.x,
        y: a * m.y + b * n.y,
        z: a * m.z + b * n.z,
    }
}

/// The elementwise product.
#[cube]
pub(super) fn elementwise(a: &Vec3, b: &Vec3) -> Vec3 {
    Vec3 {
        x: a.x * b.x,
        y: a.y * b.y,
        z: a.z * b.z,
    }
}

/// M v.
#[cube]
pub(super) fn mul_vec(m: &Mat3, v: &Vec3) -> Vec3 {
    Vec3 {
        x: dot(&m.x, v),
        y: dot(&m.y, v),
        z: dot(&m.z, v),
    }
}

/// Mᵀ v.
#[cube]
pub(super) fn transposed_mul_vec(m: &Mat3, v: &Vec3) -> Vec3 {
    Vec3 {
        x: m.x.x * v.x + m.y.x * v.y + m.z.x * v.z,
        y: m.x.y * v.x + m.y.y * v.y + m.z.y * v.z,
        z: m.x.z * v.x + m.y.z * v.y + m.z.z * v.z,
    }
}

#[cube]
pub(super) fn transpose(m: &Mat3) -> Mat3 {
    Mat3 {
        x: Vec3 {
            x: m.x.x,
            y: m.y.x,
            z: m.z.x,
        },
        y: Vec3 {
            x: m.x.y,
            y: m.y.y,
            z: m.z.y,
        },
        z: Vec3 {
            x: m.x.z,
            y: m.y.z,
            z: m.z.z,
        },
    }
}

/// A B.
#[cube]
pub(super) fn product(a: &Mat3, b: &Mat3) -> Mat3 {
    Mat3 {
        x: transposed_mul_vec(b, &a.x),
        y: transposed_mul_vec(b, &a.y),
        z: transposed_mul_vec(b, &a.z),
    }
}

/// A matrix with its columns multiplied by `v`.
#[cube]
pub(super) fn scale_columns(m: &Mat3, v: &Vec3) -> Mat3 {
    Mat3 {
        x: elementwise(&m.x, v),
        y: elementwise(&m.y, v),
        z: elementwise(&m.z, v),
    }
}

/// M + a bᵀ.
#[cube]
pub(super) fn add_outer(m: &Mat3, a: &Vec3, b: &Vec3) -> Mat3 {
    Mat3 {
        x: linear_combination(1.0, &m.x, a.x, b),
        y: linear_combination(1.0, &m.y, a.y, b),
        z: linear_combination(1.0, &m.z, a.z, b),
    }
}
