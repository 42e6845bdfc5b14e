//! Inside a kernel: the steps of a projection, which the forward and the backward pass both need. The
//! counterpart of `projection` in `splat/projected.rs`, with the same equations.

use super::super::light::LIGHTS;
use super::super::row::{COLOUR, MEAN, OPACITY, ROTATION, SCALES};
use super::super::{LOW_PASS, MIN_ALPHA, NEAR, ROW, View};
use super::vectors::{
    Mat3, Vec3, dot, mul_vec, plus, product, read, read_rows, scale_columns, scaled,
    transposed_mul_vec,
};
use cubecl::prelude::*;

/// The numbers of a camera in a kernel's buffer: `k`, `e` and `world` of [`View`].
pub(super) fn numbers(view: &View) -> Vec<f32> {
    let k = view.k.as_flattened();
    [k, view.e.as_flattened(), view.world.as_flattened()].concat()
}

/// A camera in the frame of the body: [`View`] in a kernel.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Camera {
    pub fx: f32,
    pub skew: f32,
    pub cx: f32,
    pub fy: f32,
    pub cy: f32,
    /// Rotation and translation of the extrinsics E.
    pub rotation: Mat3,
    pub shift: Vec3,
    pub world: Mat3,
}

/// Reads the camera from a buffer of [`numbers`].
#[cube]
pub(super) fn camera(view: &[f32]) -> Camera {
    Camera {
        fx: view[0],
        skew: view[1],
        cx: view[2],
        fy: view[4],
        cy: view[5],
        rotation: read_rows(view, 6, 4),
        shift: Vec3 {
            x: view[9],
            y: view[13],
            z: view[17],
        },
        world: read_rows(view, 18, 3),
    }
}

/// The steps from a splat's parameters to its conic.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Projection {
    /// Whether the splat is visible. Gradients flow only then.
    pub visible: bool,
    pub opacity: f32,
    pub mean: Vec3,
    pub deviations: Vec3,
    pub colour: Vec3,
    /// Linear part A of the transform.
    pub own: Mat3,
    /// W = E A.
    pub linear: Mat3,
    /// Mean in the camera's frame, metres, and its z, at least [`NEAR`].
    pub camera_mean: Vec3,
    pub depth: f32,
    /// Length of the quaternion, and its real and imaginary part at a length of 1.
    pub length: f32,
    pub w: f32,
    pub xyz: Vec3,
    /// R.
    pub rotation: Mat3,
    /// W R S.
    pub axes: Mat3,
    /// Rows of the Jacobian J of the projection.
    pub across: Vec3,
    pub down: Vec3,
    /// Rows of J W R S, whose product with its transpose is the covariance in the picture.
    pub projected_axes_u: Vec3,
    pub projected_axes_v: Vec3,
    /// R e₃.
    pub outward: Vec3,
    /// A R e₃ normalised, and its length before.
    pub normal: Vec3,
    pub normal_length: f32,
    /// The unit normal in the world.
    pub world_normal: Vec3,
    /// Variances in the picture along x and y, pixels².
    pub cov_xx: f32,
    pub cov_yy: f32,
    /// Inverse covariance in the picture, the conic.
    pub xx: f32,
    pub xy: f32,
    pub yy: f32,
}

/// Whether `x` is neither infinite nor NaN, by its bits: drivers may compute as if there were no NaN.
#[cube]
fn is_finite(x: f32) -> bool {
    (x.to_bits() & 0x7f80_0000u32) != 0x7f80_0000u32
}

/// The rotation of a unit quaternion.
#[cube]
fn rotation_matrix(w: f32, v: &Vec3) -> Mat3 {
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

/// The projection of the splat with index `i` of `transforms` `[N, 12]` and `rows` `[N, 14]`.
#[cube]
pub(super) fn projection(
    transforms: &[f32],
    rows: &[f32],
    i: usize,
    camera: &Camera,
) -> Projection {
    let (at_transform, at_row) = (12 * i, ROW * i);
    let own = read_rows(transforms, at_transform, 4);
    let own_shift = Vec3 {
        x: transforms[at_transform + 3],
        y: transforms[at_transform + 7],
        z: transforms[at_transform + 11],
    };
    let mean = read(rows, at_row + MEAN);
    // [W, s] = E [A, t], μ' = W μ + s
    let linear = product(&camera.rotation, &own);
    let shift = plus(&mul_vec(&camera.rotation, &own_shift), &camera.shift);
    let camera_mean = plus(&mul_vec(&linear, &mean), &shift);
    let depth = max(camera_mean.z, NEAR);

    // R = R(q / |q|), S = diag(exp s)
    let (real, imaginary) = (rows[at_row + ROTATION], read(rows, at_row + ROTATION + 1));
    // Squares of shares of the largest number neither overflow nor vanish.
    let first = max(f32::abs(real), f32::abs(imaginary.x));
    let second = max(f32::abs(imaginary.y), f32::abs(imaginary.z));
    let largest = max(max(first, second), f32::MIN_POSITIVE);
    let share = real / largest;
    let shares = Vec3 {
        x: imaginary.x / largest,
        y: imaginary.y / largest,
        z: imaginary.z / largest,
    };
    let share_length = f32::sqrt(share * share + dot(&shares, &shares));
    let length = largest * share_length;
    let inverse = 1.0 / max(share_length, 0.5f32);
    let w = share * inverse;
    let xyz = scaled(&shares, inverse);
    let rotation = rotation_matrix(w, &xyz);
    let scales = read(rows, at_row + SCALES);
    let deviations = Vec3 {
        x: f32::exp(scales.x),
        y: f32::exp(scales.y),
        z: f32::exp(scales.z),
    };
    let axes = scale_columns(&product(&linear, &rotation), &deviations);

    // J: derivative of the pixel (fx x / z + skew y / z + cx, fy y / z + cy) at μ'
    let square = depth * depth;
    let across = Vec3 {
        x: camera.fx / depth,
        y: camera.skew / depth,
        z: -(camera.fx * camera_mean.x + camera.skew * camera_mean.y) / square,
    };
    let down = Vec3 {
        x: 0.0f32,
        y: camera.fy / depth,
        z: -camera.fy * camera_mean.y / square,
    };
    // Σ' = J W R S (J W R S)ᵀ = J W Σ Wᵀ Jᵀ, plus the low-pass filter on the diagonal (3DGS, eq. 5 and 6)
    let projected_axes_u = transposed_mul_vec(&axes, &across);
    let projected_axes_v = transposed_mul_vec(&axes, &down);
    let cov_xx = dot(&projected_axes_u, &projected_axes_u) + LOW_PASS;
    let cov_xy = dot(&projected_axes_u, &projected_axes_v);
    let cov_yy = dot(&projected_axes_v, &projected_axes_v) + LOW_PASS;
    // |p₀ × p₁|² + λ (|p₀|² + |p₁|²) + λ², a sum without cancellation
    let (u, v) = (projected_axes_u, projected_axes_v);
    let minors = Vec3 {
        x: u.y * v.z - u.z * v.y,
        y: u.z * v.x - u.x * v.z,
        z: u.x * v.y - u.y * v.x,
    };
    let determinant = dot(&minors, &minors) + LOW_PASS * (cov_xx + cov_yy - LOW_PASS);
    let xx = cov_yy / determinant;
    let xy = -cov_xy / determinant;
    let yy = cov_xx / determinant;

    // n = A R e₃ / |A R e₃|
    let outward = Vec3 {
        x: rotation.x.z,
        y: rotation.y.z,
        z: rotation.z.z,
    };
    let long = mul_vec(&own, &outward);
    let normal_length = max(f32::sqrt(dot(&long, &long)), 1e-6f32);
    let normal = scaled(&long, 1.0 / normal_length);
    let world_normal = mul_vec(&camera.world, &normal);

    let opacity = 1.0 / (1.0 + f32::exp(-rows[at_row + OPACITY]));
    let opaque = is_finite(opacity) && opacity > MIN_ALPHA;
    let ahead = is_finite(camera_mean.z) && camera_mean.z > NEAR;
    let colour = read(rows, at_row + COLOUR);
    let shown = is_finite(colour.x) && is_finite(colour.y) && is_finite(colour.z);
    let sound = is_finite(xx) && is_finite(xy) && is_finite(yy) && shown;
    Projection {
        visible: opaque && ahead && sound,
        opacity,
        mean,
        deviations,
        colour,
        own,
        linear,
        camera_mean,
        depth,
        length,
        w,
        xyz,
        rotation,
        axes,
        across,
        down,
        projected_axes_u,
        projected_axes_v,
        outward,
        normal,
        normal_length,
        world_normal,
        cov_xx,
        cov_yy,
        xx,
        xy,
        yy,
    }
}

/// The terms bᵢ of the light at the unit vector n, as `terms` of the module `light` gives them.
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

/// The factor of the light `[3, 8]` on a colour channel, 1 + Σ lᵢ bᵢ(n).
#[cube]
pub(super) fn shade(light: &[f32], #[comptime] channel: usize, terms: &Array<f32>) -> f32 {
    let mut shade = 1.0f32;
    #[unroll]
    for k in 0..LIGHTS {
        shade += light[channel * LIGHTS + k] * terms[k];
    }
    shade
}
