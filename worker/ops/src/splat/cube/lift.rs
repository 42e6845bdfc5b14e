//! Inside a kernel: what both directions compute of a splat. The counterpart of `lift` in `flat`.

use super::super::flat::MIN_DETERMINANT;
use super::super::light::LIGHTS;
use super::super::{LEAST, LOW_PASS, NEAR, ROW, Sight};
use super::vectors::{
    Mat3, Vec3, carried, carried_back, dot, plus, product, read, read_rows, scaled, stretched,
};
use cubecl::prelude::*;

/// Numbers of a camera in a kernel's list: `k`, `e` and `world` of [`Sight`].
pub(super) fn numbers(sight: &Sight) -> Vec<f32> {
    let k = sight.k.as_flattened();
    [k, sight.e.as_flattened(), sight.world.as_flattened()].concat()
}

/// A camera in the frame of the body, as [`Sight`].
#[derive(CubeType, Clone, Copy)]
pub(super) struct Camera {
    pub fx: f32,
    pub skew: f32,
    pub cx: f32,
    pub fy: f32,
    pub cy: f32,
    /// Turn and shift of `e`.
    pub turn: Mat3,
    pub shift: Vec3,
    pub world: Mat3,
}

/// The camera of a list of [`numbers`].
#[cube]
pub(super) fn camera(sight: &[f32]) -> Camera {
    Camera {
        fx: sight[0],
        skew: sight[1],
        cx: sight[2],
        fy: sight[4],
        cy: sight[5],
        turn: read_rows(sight, 6, 4),
        shift: Vec3 {
            x: sight[9],
            y: sight[13],
            z: sight[17],
        },
        world: read_rows(sight, 18, 3),
    }
}

/// A splat in front of the camera, with the steps on the way.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Lifted {
    /// Whether it can be seen. Gradients flow only then.
    pub visible: bool,
    pub opacity: f32,
    pub mean: Vec3,
    pub deviations: Vec3,
    pub colour: Vec3,
    /// Linear part A of the transform.
    pub own: Mat3,
    /// E A.
    pub linear: Mat3,
    /// Camera coordinates, metres, and z, at least [`NEAR`].
    pub at: Vec3,
    pub depth: f32,
    /// The quaternion: its length, and it with a length of 1.
    pub length: f32,
    pub w: f32,
    pub xyz: Vec3,
    /// R.
    pub turn: Mat3,
    /// E A R S.
    pub axes: Mat3,
    /// Rows of the projection's Jacobian J.
    pub across: Vec3,
    pub down: Vec3,
    /// Rows of J E A R S.
    pub flat_across: Vec3,
    pub flat_down: Vec3,
    /// R e₃.
    pub outward: Vec3,
    /// A R e₃ with a length of 1, and its length before.
    pub normal: Vec3,
    pub normal_length: f32,
    /// The normal in the world.
    pub world: Vec3,
    /// Inverse covariance in the picture.
    pub xx: f32,
    pub xy: f32,
    pub yy: f32,
}

/// Neither infinite nor NaN. By the bits: drivers may compute as if there were no NaN.
#[cube]
fn is_finite(x: f32) -> bool {
    (x.to_bits() & 0x7f80_0000u32) != 0x7f80_0000u32
}

/// The rotation of a unit quaternion.
#[cube]
fn rotation(w: f32, v: &Vec3) -> Mat3 {
    Mat3 {
        x: Vec3 {
            x: 1.0 - 2.0 * (v.y * v.y + v.z * v.z),
            y: 2.0 * (v.x * v.y - w * v.z),
            z: 2.0 * (v.x * v.z + w * v.y),
        },
        y: Vec3 {
            x: 2.0 * (v.x * v.y + w * v.z),
            y: 1.0 - 2.0 * (v.x * v.x + v.z * v.z),
            z: 2.0 * (v.y * v.z - w * v.x),
        },
        z: Vec3 {
            x: 2.0 * (v.x * v.z - w * v.y),
            y: 2.0 * (v.y * v.z + w * v.x),
            z: 1.0 - 2.0 * (v.x * v.x + v.y * v.y),
        },
    }
}

/// Splat number `i` of `transforms` `[N, 12]` and `rows` `[N, 14]`.
#[cube]
pub(super) fn lift(transforms: &[f32], rows: &[f32], i: usize, camera: &Camera) -> Lifted {
    let (at_transform, at_row) = (12 * i, ROW * i);
    let own = read_rows(transforms, at_transform, 4);
    let own_shift = Vec3 {
        x: transforms[at_transform + 3],
        y: transforms[at_transform + 7],
        z: transforms[at_transform + 11],
    };
    let mean = read(rows, at_row);
    let linear = product(&camera.turn, &own);
    let shift = plus(&carried(&camera.turn, &own_shift), &camera.shift);
    let at = plus(&carried(&linear, &mean), &shift);
    let depth = max(at.z, NEAR);

    let (real, imaginary) = (rows[at_row + 3], read(rows, at_row + 4));
    let length = f32::sqrt(real * real + dot(&imaginary, &imaginary));
    let inverse = 1.0 / max(length, f32::MIN_POSITIVE);
    let w = real * inverse;
    let xyz = scaled(&imaginary, inverse);
    let turn = rotation(w, &xyz);
    let scales = read(rows, at_row + 7);
    let deviations = Vec3 {
        x: f32::exp(scales.x),
        y: f32::exp(scales.y),
        z: f32::exp(scales.z),
    };
    let axes = stretched(&product(&linear, &turn), &deviations);

    let square = depth * depth;
    let across = Vec3 {
        x: camera.fx / depth,
        y: camera.skew / depth,
        z: -(camera.fx * at.x + camera.skew * at.y) / square,
    };
    let down = Vec3 {
        x: 0.0f32,
        y: camera.fy / depth,
        z: -camera.fy * at.y / square,
    };
    let flat_across = carried_back(&axes, &across);
    let flat_down = carried_back(&axes, &down);
    let cov_xx = dot(&flat_across, &flat_across) + LOW_PASS;
    let cov_xy = dot(&flat_across, &flat_down);
    let cov_yy = dot(&flat_down, &flat_down) + LOW_PASS;
    let determinant = max(cov_xx * cov_yy - cov_xy * cov_xy, MIN_DETERMINANT);
    let xx = cov_yy / determinant;
    let xy = -cov_xy / determinant;
    let yy = cov_xx / determinant;

    let outward = Vec3 {
        x: turn.x.z,
        y: turn.y.z,
        z: turn.z.z,
    };
    let long = carried(&own, &outward);
    let normal_length = max(f32::sqrt(dot(&long, &long)), 1e-6f32);
    let normal = scaled(&long, 1.0 / normal_length);
    let world = carried(&camera.world, &normal);

    let opacity = 1.0 / (1.0 + f32::exp(-rows[at_row + 10]));
    let opaque = is_finite(opacity) && opacity > LEAST;
    let ahead = is_finite(at.z) && at.z > NEAR;
    let sound = is_finite(xx) && is_finite(xy) && is_finite(yy);
    Lifted {
        visible: opaque && ahead && sound,
        opacity,
        mean,
        deviations,
        colour: read(rows, at_row + 11),
        own,
        linear,
        at,
        depth,
        length,
        w,
        xyz,
        turn,
        axes,
        across,
        down,
        flat_across,
        flat_down,
        outward,
        normal,
        normal_length,
        world,
        xx,
        xy,
        yy,
    }
}

/// The terms of the light at the unit vector `n`, as [`terms`](super::super::light::terms).
#[cube]
pub(super) fn light_terms(n: &Vec3) -> Array<f32> {
    let mut terms = Array::<f32>::new(LIGHTS);
    terms[0usize] = n.x;
    terms[1usize] = n.y;
    terms[2usize] = n.z;
    terms[3usize] = n.x * n.y;
    terms[4usize] = n.y * n.z;
    terms[5usize] = n.z * n.x;
    terms[6usize] = n.x * n.x - n.y * n.y;
    terms[7usize] = 3.0 * n.z * n.z - 1.0;
    terms
}

/// The factor of the light `[3, 8]` on a colour channel.
#[cube]
pub(super) fn shade(light: &[f32], #[comptime] channel: usize, terms: &Array<f32>) -> f32 {
    let mut shade = 1.0f32;
    #[unroll]
    for k in 0..LIGHTS {
        shade += light[channel * LIGHTS + k] * terms[k];
    }
    shade
}
