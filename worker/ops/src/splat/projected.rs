//! Projection of one splat onto the picture, and its gradient. The equations are those of 3D Gaussian
//! splatting (Kerbl and others, arXiv 2308.04079, eq. 4 to 6 and appendix A), whose J is that of EWA
//! splatting (Zwicker and others, 2001); W is here E A: the camera's rotation times the linear part of the
//! splat's own transform.
//!
//! In the backward functions, `to_x` is the gradient of the loss with respect to x.

use super::light::{LIGHTS, terms, terms_backward};
use super::{LOW_PASS, MIN_ALPHA, NEAR, View};

type Vec3 = [f32; 3];
type Mat3 = [[f32; 3]; 3];

/// Largest half width or height of a splat in the picture, pixels, far beyond any picture: the indices of its tiles are
/// whole numbers.
pub(super) const LARGEST_EXTENT: f32 = 1e9;
/// Length of a quaternion below which its gradient grows no further: that of a direction is in proportion to 1 / |q|.
pub(super) const SHORTEST: f32 = 1e-12;

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

/// Gradient to a [`Projected`].
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ProjectedGradient {
    pub centre: [f32; 2],
    pub conic: Vec3,
    pub opacity: f32,
    pub colour: Vec3,
}

impl ProjectedGradient {
    /// Adds another.
    pub fn add(&mut self, other: &Self) {
        for a in 0..2 {
            self.centre[a] += other.centre[a];
        }
        for a in 0..3 {
            self.conic[a] += other.conic[a];
            self.colour[a] += other.colour[a];
        }
        self.opacity += other.opacity;
    }
}

/// Gradient to the parameters of a splat, and to the light.
pub(super) struct SplatGradient {
    pub transform: [f32; 12],
    pub mean: Vec3,
    pub rotation: [f32; 4],
    pub scale: Vec3,
    pub opacity: f32,
    pub colour: Vec3,
    pub light: [[f32; LIGHTS]; 3],
}

/// The steps of a projection, which the forward and the backward pass both need.
struct Projection {
    /// Canonical frame to camera, E [A, t], row by row.
    model_view: [[f32; 4]; 3],
    /// Mean in the camera's frame, metres.
    camera_mean: Vec3,
    /// R.
    rotation: Mat3,
    /// q / |q|.
    unit_quaternion: [f32; 4],
    /// |q|.
    quaternion_length: f32,
    /// Diagonal of S: standard deviations, metres.
    deviations: Vec3,
    /// W R S with W = E A.
    axes: Mat3,
    /// J, 2 rows of 3.
    jacobian: [Vec3; 2],
    /// J W R S, whose product with its transpose is the covariance in the picture.
    projected_axes: [Vec3; 2],
    /// A R e₃ in the body frame, not normalised, and its length.
    normal: Vec3,
    normal_length: f32,
    /// Unit normal in the world.
    world_normal: Vec3,
    /// Variances in the picture along x and y, pixels².
    variances: [f32; 2],
    /// Inverse covariance in the picture: xx, xy, yy.
    conic: Vec3,
}

#[inline(always)]
fn dot(a: Vec3, b: Vec3) -> f32 {
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
fn column(m: &Mat3, c: usize) -> Vec3 {
    [m[0][c], m[1][c], m[2][c]]
}

/// Row `r` of the linear part of a 3x4 transform.
#[inline(always)]
fn row(t: &[f32; 12], r: usize) -> Vec3 {
    [t[4 * r], t[4 * r + 1], t[4 * r + 2]]
}

#[inline(always)]
fn logistic(x: f32) -> f32 {
    1.0 / (1.0 + (-x).exp())
}

/// The steps from a splat's parameters to its conic.
#[inline(always)]
fn projection(splat: &Splat<'_>, view: &View) -> Projection {
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
fn shades(light: &[[f32; LIGHTS]; 3], world_normal: Vec3) -> Vec3 {
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

/// The gradient to the parameters of a visible splat, from the gradient `to` its projection.
#[inline(always)]
pub(super) fn project_backward(
    splat: &Splat<'_>,
    light: &[[f32; LIGHTS]; 3],
    view: &View,
    to: &ProjectedGradient,
) -> SplatGradient {
    let projection = projection(splat, view);
    let opacity = logistic(splat.opacity);
    let mut gradient = SplatGradient {
        transform: [0.0; 12],
        mean: [0.0; 3],
        rotation: [0.0; 4],
        scale: [0.0; 3],
        // o = logistic(x): ∂o/∂x = o (1 − o)
        opacity: to.opacity * opacity * (1.0 - opacity),
        colour: [0.0; 3],
        light: [[0.0; LIGHTS]; 3],
    };
    let to_normal = light_backward(splat, light, view, &projection, to, &mut gradient);
    let to_projected_axes = covariance_backward(&projection, to);
    let to_camera_mean = perspective_backward(&projection, view, to, &to_projected_axes);
    // Of P = J M with M = W R S: ∂L/∂M = Jᵀ ∂L/∂P
    let to_axes: Mat3 = std::array::from_fn(|c| {
        let (across, down) = (projection.jacobian[0][c], projection.jacobian[1][c]);
        std::array::from_fn(|k| across * to_projected_axes[0][k] + down * to_projected_axes[1][k])
    });
    let (mean, rotation, deviations) = (splat.mean, &projection.rotation, projection.deviations);
    // Of μ' = W μ + s and M = W (R S): ∂L/∂W = ∂L/∂μ' μᵀ + ∂L/∂M (R S)ᵀ, ∂L/∂s = ∂L/∂μ'
    let scaled: Mat3 = rotation.map(|row| std::array::from_fn(|k| row[k] * deviations[k]));
    let to_model_view: [[f32; 4]; 3] = std::array::from_fn(|a| {
        let linear = |b: usize| to_camera_mean[a] * mean[b] + dot(to_axes[a], scaled[b]);
        [linear(0), linear(1), linear(2), to_camera_mean[a]]
    });
    for (r, to_row) in gradient
        .transform
        .as_chunks_mut::<4>()
        .0
        .iter_mut()
        .enumerate()
    {
        // Of [W, s] = E [A, t]: ∂L/∂[A, t] = Eᵀ ∂L/∂[W, s]; and of the normal A R e₃: ∂L/∂A += ∂L/∂n (R e₃)ᵀ
        let e = [view.e[0][r], view.e[1][r], view.e[2][r]];
        for (b, to) in to_row.iter_mut().enumerate() {
            *to = dot(
                e,
                [
                    to_model_view[0][b],
                    to_model_view[1][b],
                    to_model_view[2][b],
                ],
            );
        }
        for (to, axes) in to_row.iter_mut().zip(rotation) {
            *to += to_normal[r] * axes[2];
        }
    }
    let linear: Mat3 = projection.model_view.map(|[a, b, c, _]| [a, b, c]);
    // ∂L/∂μ = Wᵀ ∂L/∂μ'
    gradient.mean = std::array::from_fn(|b| dot(column(&linear, b), to_camera_mean));
    // ∂L/∂(R S) = Wᵀ ∂L/∂M
    let to_scaled: Mat3 = std::array::from_fn(|b| {
        std::array::from_fn(|k| dot(column(&linear, b), column(&to_axes, k)))
    });
    // Of S = diag(exp s): ∂L/∂s = S diag(Rᵀ ∂L/∂(R S))
    gradient.scale =
        std::array::from_fn(|k| deviations[k] * dot(column(&to_scaled, k), column(rotation, k)));
    // ∂L/∂R = ∂L/∂(R S) S, and of the normal its third column Aᵀ ∂L/∂n
    let mut to_rotation: Mat3 =
        to_scaled.map(|row| std::array::from_fn(|k| row[k] * deviations[k]));
    let t = splat.transform;
    for (b, to_row) in to_rotation.iter_mut().enumerate() {
        to_row[2] += dot([t[b], t[4 + b], t[8 + b]], to_normal);
    }
    gradient.rotation = rotation_backward(&projection, &to_rotation);
    gradient
}

/// Writes the gradients to colour and light, and returns the gradient to the normal A R e₃ before it is
/// normalised, in the body frame.
#[inline(always)]
fn light_backward(
    splat: &Splat<'_>,
    light: &[[f32; LIGHTS]; 3],
    view: &View,
    projection: &Projection,
    to: &ProjectedGradient,
    gradient: &mut SplatGradient,
) -> Vec3 {
    let (terms, shades) = (
        terms(projection.world_normal),
        shades(light, projection.world_normal),
    );
    let mut to_terms = [0f32; LIGHTS];
    for c in 0..3 {
        // Of the lit colour c (1 + Σ lᵢ bᵢ)
        gradient.colour[c] = to.colour[c] * shades[c];
        let to_shade = to.colour[c] * splat.colour[c];
        for k in 0..LIGHTS {
            gradient.light[c][k] = to_shade * terms[k];
            to_terms[k] += to_shade * light[c][k];
        }
    }
    let to_world = terms_backward(projection.world_normal, to_terms);
    let to_unit: Vec3 = std::array::from_fn(|c| dot(column(&view.world, c), to_world));
    let unit = projection.normal.map(|v| v / projection.normal_length);
    // Of v / |v|: (I − n nᵀ) ∂L/∂n / |v|
    let along = dot(to_unit, unit);
    std::array::from_fn(|c| (to_unit[c] - along * unit[c]) / projection.normal_length)
}

/// Gradient to P = J W R S, from the gradient to the conic Q = (P Pᵀ + low-pass)⁻¹.
#[inline(always)]
fn covariance_backward(projection: &Projection, to: &ProjectedGradient) -> [Vec3; 2] {
    let [xx, xy, yy] = projection.conic;
    let conic = [[xx, xy], [xy, yy]];
    // The conic's xy stands for two entries of the symmetric matrix.
    let to_conic = [
        [to.conic[0], to.conic[1] / 2.0],
        [to.conic[1] / 2.0, to.conic[2]],
    ];
    let product = |a: [[f32; 2]; 2], b: [[f32; 2]; 2]| -> [[f32; 2]; 2] {
        a.map(|[x, y]| [x * b[0][0] + y * b[1][0], x * b[0][1] + y * b[1][1]])
    };
    // dQ = −Q dΣ' Q, so ∂L/∂Σ' = −Q ∂L/∂Q Q; and dΣ' = dP Pᵀ + P dPᵀ, so ∂L/∂P = 2 ∂L/∂Σ' P
    let to_covariance = product(product(conic, to_conic), conic);
    to_covariance.map(|[x, y]| {
        std::array::from_fn(|k| {
            -2.0 * (x * projection.projected_axes[0][k] + y * projection.projected_axes[1][k])
        })
    })
}

/// Gradient to the mean (x, y, z) in the camera's frame, through the centre and through the Jacobian J.
#[inline(always)]
fn perspective_backward(
    projection: &Projection,
    view: &View,
    to: &ProjectedGradient,
    to_projected_axes: &[Vec3; 2],
) -> Vec3 {
    // Of P = J M: ∂L/∂J = ∂L/∂P Mᵀ
    let to_jacobian = |i: usize, c: usize| dot(to_projected_axes[i], projection.axes[c]);
    let [[fx, skew, _], [_, fy, _]] = view.k;
    let ([x, y, _], z) = (projection.camera_mean, projection.camera_mean[2].max(NEAR));
    let [u, v] = to.centre;
    let across = fx * x + skew * y;
    let z2 = z * z;
    let (by_across, by_down) = (to_jacobian(0, 2), to_jacobian(1, 2));
    // Jᵀ ∂L/∂centre + Σ ∂L/∂Jᵢⱼ ∂Jᵢⱼ/∂μ', where J has entries fx / z, skew / z, fy / z,
    // −(fx x + skew y) / z² and −fy y / z².
    [
        u * fx / z - by_across * fx / z2,
        u * skew / z + v * fy / z - by_across * skew / z2 - by_down * fy / z2,
        -(u * across + v * fy * y) / z2
            - (to_jacobian(0, 0) * fx + to_jacobian(0, 1) * skew + to_jacobian(1, 1) * fy) / z2
            + 2.0 * (by_across * across + by_down * fy * y) / (z2 * z),
    ]
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

/// Gradient to a quaternion of any length, from the gradient to its rotation matrix.
#[inline(always)]
fn rotation_backward(projection: &Projection, to: &Mat3) -> [f32; 4] {
    let [w, x, y, z] = projection.unit_quaternion;
    // ∂L/∂q̂ₖ = Σ ∂L/∂Rᵢⱼ ∂Rᵢⱼ/∂q̂ₖ (3DGS, appendix A)
    let to_unit = [
        x * (to[2][1] - to[1][2]) + y * (to[0][2] - to[2][0]) + z * (to[1][0] - to[0][1]),
        y * (to[0][1] + to[1][0]) + z * (to[0][2] + to[2][0]) + w * (to[2][1] - to[1][2])
            - 2.0 * x * (to[1][1] + to[2][2]),
        x * (to[0][1] + to[1][0]) + z * (to[1][2] + to[2][1]) + w * (to[0][2] - to[2][0])
            - 2.0 * y * (to[0][0] + to[2][2]),
        x * (to[0][2] + to[2][0]) + y * (to[1][2] + to[2][1]) + w * (to[1][0] - to[0][1])
            - 2.0 * z * (to[0][0] + to[1][1]),
    ]
    .map(|v| 2.0 * v);
    // Of q̂ = q / |q|: (I − q̂ q̂ᵀ) ∂L/∂q̂ / |q|
    let along = to_unit[0] * w + to_unit[1] * x + to_unit[2] * y + to_unit[3] * z;
    let length = projection.quaternion_length.max(SHORTEST);
    std::array::from_fn(|k| (to_unit[k] - along * projection.unit_quaternion[k]) / length)
}
