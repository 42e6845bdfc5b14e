//! Projection of one splat onto the picture. The equations are those of 3D Gaussian splatting (Kerbl and
//! others, arXiv 2308.04079, eq. 4 to 6), whose J is that of EWA splatting (Zwicker and others, 2001); W is
//! here E A: the camera's rotation times the linear part of the splat's own transform. Gradients are in
//! `projected_backward.rs`.

use super::light::{LIGHTS, terms};
use super::{LOW_PASS, MIN_ALPHA, NEAR, View};

pub(super) type Vec3 = [f32; 3];
pub(super) type Mat3 = [[f32; 3]; 3];

/// Largest half width or height of a splat in the picture, pixels, far beyond any picture: the indices of its tiles are
/// whole numbers.
pub(super) const LARGEST_EXTENT: f32 = 1e9;

/// The parameters of a splat.
#[derive(Clone, Copy)]
pub(super) struct Splat<'a> {
    /// Canonical to posed body, row-major 3x4: A and t.
    pub transform: &'a [f32; 12],
    /// Canonical mean μ, metres.
    pub mean: Vec3,
    /// Quaternion q, real part first, not normalised.
    pub rotation: [f32; 4],
    /// Logarithms of the standard deviations, metres.
    pub scale: Vec3,
    /// Logit of the opacity.
    pub opacity: f32,
    pub colour: Vec3,
}

/// A splat projected onto the picture. Its opacity is 0 if it is behind the camera or too transparent.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Projected {
    /// Centre, pixels.
    pub centre: [f32; 2],
    /// Inverse covariance: xx, xy, yy, 1/pixels².
    pub conic: Vec3,
    /// Opacity at the centre.
    pub opacity: f32,
    /// Lit colour.
    pub colour: Vec3,
    /// Distance along the camera's axis, metres.
    pub depth: f32,
    /// Largest offsets from the centre along x and y where the opacity is at least [`MIN_ALPHA`], pixels.
    pub extent: [f32; 2],
}

/// The steps of a projection, which the forward and the backward pass both need.
pub(super) struct Projection {
    /// Canonical frame to camera, E [A, t], row by row.
    pub model_view: [[f32; 4]; 3],
    /// Mean in the camera's frame, metres.
    pub camera_mean: Vec3,
    /// R.
    pub rotation: Mat3,
    /// q / |q|.
    pub unit_quaternion: [f32; 4],
    /// |q|.
    pub quaternion_length: f32,
    /// Diagonal of S: standard deviations, metres.
    pub deviations: Vec3,
    /// W R S with W = E A.
    pub axes: Mat3,
    /// J, 2 rows of 3.
    pub jacobian: [Vec3; 2],
    /// J W R S, whose product with its transpose is the covariance in the picture.
    pub projected_axes: [Vec3; 2],
    /// A R e₃ in the body frame, not normalised, and its length.
    pub normal: Vec3,
    pub normal_length: f32,
    /// Unit normal in the world.
    pub world_normal: Vec3,
    /// Variances in the picture along x and y, pixels².
    pub variances: [f32; 2],
    /// Inverse covariance in the picture: xx, xy, yy.
    pub conic: Vec3,
}

#[inline(always)]
pub(super) fn dot(a: Vec3, b: Vec3) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// Column `c` of a matrix.
#[inline(always)]
pub(super) fn column(m: &Mat3, c: usize) -> Vec3 {
    [m[0][c], m[1][c], m[2][c]]
}

/// Row `r` of the linear part of a 3x4 transform.
#[inline(always)]
fn row(t: &[f32; 12], r: usize) -> Vec3 {
    [t[4 * r], t[4 * r + 1], t[4 * r + 2]]
}

#[inline(always)]
pub(super) fn logistic(x: f32) -> f32 {
    1.0 / (1.0 + (-x).exp())
}

/// The steps from a splat's parameters to its conic.
#[inline(always)]
pub(super) fn projection(splat: &Splat<'_>, view: &View) -> Projection {
    let t = splat.transform;
    // [W, s] = E [A, t]
    let model_view: [[f32; 4]; 3] = std::array::from_fn(|i| {
        let [a, b, c, shift] = view.e[i];
        let composed = |j: usize| a * t[j] + b * t[4 + j] + c * t[8 + j];
        [composed(0), composed(1), composed(2), composed(3) + shift]
    });
    let linear: Mat3 = model_view.map(|[a, b, c, _]| [a, b, c]);
    // μ' = W μ + s
    let camera_mean: Vec3 = std::array::from_fn(|i| dot(linear[i], splat.mean) + model_view[i][3]);
    // R = R(q / |q|)
    let (unit_quaternion, quaternion_length) = direction(splat.rotation);
    let rotation = rotation_matrix(unit_quaternion);
    // S = diag(exp s); the covariance in space is R S Sᵀ Rᵀ (eq. 6).
    let deviations = splat.scale.map(f32::exp);
    let axes: Mat3 = std::array::from_fn(|i| {
        std::array::from_fn(|j| deviations[j] * dot(linear[i], column(&rotation, j)))
    });
    // J: derivative of the pixel (fx x / z + skew y / z + cx, fy y / z + cy) at μ'.
    let ([x, y, _], z) = (camera_mean, camera_mean[2].max(NEAR));
    let [[fx, skew, _], [_, fy, _]] = view.k;
    let jacobian = [
        [fx / z, skew / z, -(fx * x + skew * y) / (z * z)],
        [0.0, fy / z, -fy * y / (z * z)],
    ];
    // Σ' = J W R S (J W R S)ᵀ = J W Σ Wᵀ Jᵀ (eq. 5), plus the low-pass filter on the diagonal.
    let projected_axes: [Vec3; 2] =
        std::array::from_fn(|i| std::array::from_fn(|k| dot(jacobian[i], column(&axes, k))));
    let squares = projected_axes.map(|row| dot(row, row));
    let xy = dot(projected_axes[0], projected_axes[1]);
    let variances = squares.map(|square| square + LOW_PASS);
    // det(P Pᵀ + λ I) = |p₀ × p₁|² + λ (|p₀|² + |p₁|²) + λ², a sum without cancellation: of a long and thin splat, the
    // difference xx yy − xy² is less than the rounding of its terms.
    let minors = cross(projected_axes[0], projected_axes[1]);
    let determinant = dot(minors, minors) + LOW_PASS * (squares[0] + squares[1] + LOW_PASS);
    // n = A R e₃ / |A R e₃|: a splat on a surface is flat along its third axis.
    let outward = column(&rotation, 2);
    let normal: Vec3 = std::array::from_fn(|i| dot(row(t, i), outward));
    let normal_length = dot(normal, normal).sqrt().max(1e-6);
    let world_normal = view.world.map(|row| dot(row, normal) / normal_length);
    Projection {
        model_view,
        camera_mean,
        rotation,
        unit_quaternion,
        quaternion_length,
        deviations,
        axes,
        jacobian,
        projected_axes,
        normal,
        normal_length,
        world_normal,
        variances,
        // Σ'⁻¹ = [yy, −xy; −xy, xx] / det Σ'
        conic: [
            variances[1] / determinant,
            -xy / determinant,
            variances[0] / determinant,
        ],
    }
}

/// Factors of the light on each colour channel, 1 + Σ lᵢ bᵢ(n), at the unit normal in the world.
#[inline(always)]
pub(super) fn shades(light: &[[f32; LIGHTS]; 3], world_normal: Vec3) -> Vec3 {
    let terms = terms(world_normal);
    light.map(|light| {
        let mut shade = 1.0;
        for (light, term) in light.iter().zip(&terms) {
            shade += light * term;
        }
        shade
    })
}

/// The splat projected onto the picture.
#[inline(always)]
pub(super) fn project(splat: &Splat<'_>, light: &[[f32; LIGHTS]; 3], view: &View) -> Projected {
    let opacity = logistic(splat.opacity);
    let projection = projection(splat, view);
    let [x, y, z] = projection.camera_mean;
    // Comparisons are false for a NaN.
    let visible = opacity > MIN_ALPHA && z > NEAR && projection.conic.iter().all(|c| c.is_finite());
    let shades = shades(light, projection.world_normal);
    let colour: Vec3 = std::array::from_fn(|c| splat.colour[c] * shades[c]);
    if !visible || !colour.iter().all(|c| c.is_finite()) {
        return Projected::default();
    }
    let [[fx, skew, cx], [_, fy, cy]] = view.k;
    // The opacity o exp(−q / 2) is MIN_ALPHA where q = dᵀ Σ'⁻¹ d = 2 ln(o / MIN_ALPHA).
    let edge = 2.0 * (opacity / MIN_ALPHA).ln();
    Projected {
        centre: [(fx * x + skew * y) / z + cx, fy * y / z + cy],
        conic: projection.conic,
        opacity,
        colour,
        depth: z,
        // That ellipse reaches √(q Σ'xx) along x, and √(q Σ'yy) along y.
        extent: (projection.variances).map(|variance| (edge * variance).sqrt().min(LARGEST_EXTENT)),
    }
}

/// A quaternion of length 1 in the direction of `q`, and the length of `q`; 0, whose rotation is none, if `q` is. Squares of
/// shares of the largest number neither overflow nor vanish.
#[inline(always)]
fn direction(q: [f32; 4]) -> ([f32; 4], f32) {
    let largest = q
        .iter()
        .fold(f32::MIN_POSITIVE, |most, v| most.max(v.abs()));
    let shares = q.map(|v| v / largest);
    let square = shares.iter().map(|v| v * v).sum::<f32>();
    let length = square.sqrt();
    // The largest share is 1, unless all are 0.
    (shares.map(|v| v / length.max(0.5)), largest * length)
}

/// The rotation of a unit quaternion, real part first.
#[inline(always)]
fn rotation_matrix([w, x, y, z]: [f32; 4]) -> Mat3 {
    [
        [
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
        ],
        [
            2.0 * (x * y + w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - w * x),
        ],
        [
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
        ],
    ]
}
