//! Gradient of the projection of one splat (3D Gaussian splatting, appendix A): from the gradient to what a picture
//! shows of it to its parameters and to the light. `projected.rs` has the equations and their names.
//!
//! `to_x` is the gradient of the loss with respect to x.

use super::light::{LIGHTS, terms, terms_backward};
use super::projected::{Mat3, Projection, Splat, Vec3, column, dot, logistic, projection, shades};
use super::{NEAR, View};

/// Length of a quaternion below which its gradient grows no further: that of a direction is in proportion to 1 / |q|.
pub(super) const SHORTEST: f32 = 1e-12;

/// Gradient to a [`Projected`](super::projected::Projected).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ProjectedGradient {
    pub centre: [f32; 2],
    pub conic: Vec3,
    pub opacity: f32,
    pub colour: Vec3,
}

impl ProjectedGradient {
    /// Adds another.
    pub(super) fn add(&mut self, other: &Self) {
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
