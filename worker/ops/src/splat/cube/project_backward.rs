//! The backward pass of projection: from the gradients of projected splats to the parameters of splats and to
//! the light, with a thread per splat. The counterpart of `project_backward` in `splat/projected_backward.rs`, with the
//! same equations.

use super::super::light::LIGHTS;
use super::super::projected_backward::SHORTEST;
use super::super::row::{COLOUR, MEAN, OPACITY, ROTATION, ROW, SCALES};
use super::projection::{Camera, Projection, camera, light_terms, projection, shade};
use super::rasterize_backward::SUMS;
use super::vectors::{
    Mat3, Vec3, add_outer, dot, elementwise, linear_combination, mul_vec, plus, product, read,
    scale_columns, scaled, transpose, transposed_mul_vec, write,
};
use crate::cube::adding::{AddFloat, Bound};
use cubecl::prelude::*;

/// Threads per group, which sums the gradient to the light before it is added to that of other groups.
pub(super) const GROUP: usize = 64;
/// Numbers of the light `[3, 8]`.
const ALL_LIGHTS: usize = 3 * LIGHTS;

/// Writes the gradients `to_transforms` `[N, 12]` and `to_rows` `[N, 14]`, and adds to `to_light` `[3, 8]`, from
/// the sums `to_splats` `[N, 9]` of `rasterize_tiles_backward`.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
pub(super) fn project_splats_backward<A: AddFloat>(
    transforms: &[f32],
    rows: &[f32],
    light: &[f32],
    view: &[f32],
    to_splats: &[f32],
    to_transforms: &mut [f32],
    to_rows: &mut [f32],
    to_light: &mut [Atomic<Bound<A>>],
) {
    let unit = UNIT_POS as usize;
    let i = ABSOLUTE_POS;
    let mut shared = Shared::<[f32]>::new_slice(ALL_LIGHTS * GROUP);
    #[unroll]
    for k in 0..ALL_LIGHTS {
        shared[k * GROUP + unit] = 0.0;
    }
    if i < rows.len() / ROW {
        let camera = camera(view);
        let projection = projection(transforms, rows, i, &camera);
        if projection.visible {
            let sums = SUMS * i;
            let to_colour = read(to_splats, sums);
            let to_normal = light_backward(
                light,
                &camera,
                &projection,
                &to_colour,
                to_rows,
                i,
                &mut shared,
            );
            shape_backward(
                &camera,
                &projection,
                to_splats,
                &to_normal,
                to_transforms,
                to_rows,
                i,
            );
        } else {
            #[unroll]
            for k in 0..12usize {
                to_transforms[12 * i + k] = 0.0;
            }
            #[unroll]
            for k in 0..ROW {
                to_rows[ROW * i + k] = 0.0;
            }
        }
    }
    sync_cube();
    if unit < ALL_LIGHTS {
        let mut sum = 0.0f32;
        for other in 0..GROUP {
            sum += shared[unit * GROUP + (other + unit) % GROUP];
        }
        A::add(&mut to_light[unit], sum);
    }
}

/// Writes the gradients to colour and light, and returns the gradient to the normal A R e₃ before it is
/// normalised, in the body frame.
#[cube]
fn light_backward(
    light: &[f32],
    camera: &Camera,
    projection: &Projection,
    to_colour: &Vec3,
    to_rows: &mut [f32],
    i: usize,
    shared: &mut Shared<[f32]>,
) -> Vec3 {
    let unit = UNIT_POS as usize;
    let n = projection.world_normal;
    let terms = light_terms(&n);
    let to_shade = elementwise(to_colour, &projection.colour);
    let shades = Vec3 {
        x: shade(light, 0usize, &terms),
        y: shade(light, 1usize, &terms),
        z: shade(light, 2usize, &terms),
    };
    write(to_rows, ROW * i + COLOUR, &elementwise(to_colour, &shades));
    // Of the lit colour c (1 + Σ lᵢ bᵢ): ∂L/∂bᵢ and ∂L/∂lᵢ
    let mut to = Array::<f32>::new(LIGHTS);
    #[unroll]
    for k in 0..LIGHTS {
        to[k] = to_shade.x * light[k]
            + to_shade.y * light[LIGHTS + k]
            + to_shade.z * light[2 * LIGHTS + k];
        shared[k * GROUP + unit] = to_shade.x * terms[k];
        shared[(LIGHTS + k) * GROUP + unit] = to_shade.y * terms[k];
        shared[(2 * LIGHTS + k) * GROUP + unit] = to_shade.z * terms[k];
    }
    // ∂L/∂n = Σ ∂L/∂bᵢ ∂bᵢ/∂n
    let to_world = Vec3 {
        x: to[0usize] + to[3usize] * n.y + to[5usize] * n.z + 2.0 * to[6usize] * n.x,
        y: to[1usize] + to[3usize] * n.x + to[4usize] * n.z - 2.0 * to[6usize] * n.y,
        z: to[2usize] + to[4usize] * n.y + to[5usize] * n.x + 6.0 * to[7usize] * n.z,
    };
    // Of v / |v|: (I − n nᵀ) ∂L/∂n / |v|
    let to_unit = transposed_mul_vec(&camera.world, &to_world);
    let along = dot(&to_unit, &projection.normal);
    let inverse = 1.0 / projection.normal_length;
    linear_combination(inverse, &to_unit, -along * inverse, &projection.normal)
}

/// Writes the gradients to everything but colour and light.
#[cube]
fn shape_backward(
    camera: &Camera,
    projection: &Projection,
    to_splats: &[f32],
    to_normal: &Vec3,
    to_transforms: &mut [f32],
    to_rows: &mut [f32],
    i: usize,
) {
    let sums = SUMS * i;
    let (xx, xy, yy) = (projection.xx, projection.xy, projection.yy);
    // α = o exp(p) with p = −(xx dx² + 2 xy dx dy + yy dy²) / 2 and d = pixel − centre, so ∂p/∂centre = conic d
    let to_power = to_splats[sums + 3];
    let u = xx * to_splats[sums + 4] + xy * to_splats[sums + 5];
    let v = xy * to_splats[sums + 4] + yy * to_splats[sums + 5];
    let to_xx = -0.5f32 * to_splats[sums + 6];
    let to_xy = -0.5f32 * to_splats[sums + 7];
    let to_yy = -0.5f32 * to_splats[sums + 8];
    // With o = logistic(x), ∂α/∂x = α (1 − o).
    to_rows[ROW * i + OPACITY] = to_power * (1.0 - projection.opacity);

    // Of the conic Q = (P Pᵀ + low-pass)⁻¹ with P = J W R S: ∂L/∂Σ' = −Q ∂L/∂Q Q, ∂L/∂P = 2 ∂L/∂Σ' P
    let across_x = xx * to_xx + xy * to_xy;
    let across_y = xx * to_xy + xy * to_yy;
    let down_x = xy * to_xx + yy * to_xy;
    let down_y = xy * to_xy + yy * to_yy;
    let cov_xx = across_x * xx + across_y * xy;
    let cov_xy = across_x * xy + across_y * yy;
    let cov_yx = down_x * xx + down_y * xy;
    let cov_yy = down_x * xy + down_y * yy;
    let to_across = linear_combination(
        -2.0f32 * cov_xx,
        &projection.projected_axes_u,
        -2.0f32 * cov_xy,
        &projection.projected_axes_v,
    );
    let to_down = linear_combination(
        -2.0f32 * cov_yx,
        &projection.projected_axes_u,
        -2.0f32 * cov_yy,
        &projection.projected_axes_v,
    );
    let to_camera_mean = perspective_backward(camera, projection, u, v, &to_across, &to_down);
    // Of P = J M with M = W R S: ∂L/∂M = Jᵀ ∂L/∂P
    let to_axes = Mat3 {
        x: linear_combination(projection.across.x, &to_across, projection.down.x, &to_down),
        y: linear_combination(projection.across.y, &to_across, projection.down.y, &to_down),
        z: linear_combination(projection.across.z, &to_across, projection.down.z, &to_down),
    };

    // Of μ' = W μ + s and M = W (R S): ∂L/∂W = ∂L/∂M (R S)ᵀ + ∂L/∂μ' μᵀ; of [W, s] = E [A, t] and of the normal
    // A R e₃: ∂L/∂A = Eᵀ ∂L/∂W + ∂L/∂n (R e₃)ᵀ, ∂L/∂t = Eᵀ ∂L/∂s
    let by_scales = scale_columns(&projection.rotation, &projection.deviations);
    let to_linear = product(&to_axes, &transpose(&by_scales));
    let to_linear = add_outer(&to_linear, &to_camera_mean, &projection.mean);
    let to_own = product(&transpose(&camera.rotation), &to_linear);
    let to_own = add_outer(&to_own, to_normal, &projection.outward);
    let to_shift = transposed_mul_vec(&camera.rotation, &to_camera_mean);
    write(to_transforms, 12 * i, &to_own.x);
    write(to_transforms, 12 * i + 4, &to_own.y);
    write(to_transforms, 12 * i + 8, &to_own.z);
    to_transforms[12 * i + 3] = to_shift.x;
    to_transforms[12 * i + 7] = to_shift.y;
    to_transforms[12 * i + 11] = to_shift.z;

    // ∂L/∂μ = Wᵀ ∂L/∂μ', ∂L/∂(R S) = Wᵀ ∂L/∂M, ∂L/∂s = S diag(Rᵀ ∂L/∂(R S)), and
    // ∂L/∂R = ∂L/∂(R S) S, to whose third column the normal adds Aᵀ ∂L/∂n
    let back = transpose(&projection.linear);
    write(to_rows, ROW * i + MEAN, &mul_vec(&back, &to_camera_mean));
    let to_scaled = product(&back, &to_axes);
    let rotation = &projection.rotation;
    let along = plus(
        &plus(
            &elementwise(&to_scaled.x, &rotation.x),
            &elementwise(&to_scaled.y, &rotation.y),
        ),
        &elementwise(&to_scaled.z, &rotation.z),
    );
    write(
        to_rows,
        ROW * i + SCALES,
        &elementwise(&along, &projection.deviations),
    );
    let outward = transposed_mul_vec(&projection.own, to_normal);
    let to_rotation = scale_columns(&to_scaled, &projection.deviations);
    let third = Vec3 {
        x: 0.0f32,
        y: 0.0f32,
        z: 1.0f32,
    };
    rotation_backward(
        projection,
        &add_outer(&to_rotation, &outward, &third),
        to_rows,
        i,
    );
}

/// Gradient to the mean in the camera's frame, through the centre and through the Jacobian J.
#[cube]
fn perspective_backward(
    camera: &Camera,
    projection: &Projection,
    u: f32,
    v: f32,
    to_across: &Vec3,
    to_down: &Vec3,
) -> Vec3 {
    let z = projection.depth;
    let square = z * z;
    let across = camera.fx * projection.camera_mean.x + camera.skew * projection.camera_mean.y;
    let down = camera.fy * projection.camera_mean.y;
    // Of P = J M: ∂L/∂J = ∂L/∂P Mᵀ
    let by_across = mul_vec(&projection.axes, to_across);
    let by_down = mul_vec(&projection.axes, to_down);
    // Jᵀ ∂L/∂centre + Σ ∂L/∂Jᵢⱼ ∂Jᵢⱼ/∂μ'
    Vec3 {
        x: u * camera.fx / z - by_across.z * camera.fx / square,
        y: u * camera.skew / z + v * camera.fy / z
            - by_across.z * camera.skew / square
            - by_down.z * camera.fy / square,
        z: -(u * across + v * down) / square
            - (by_across.x * camera.fx + by_across.y * camera.skew + by_down.y * camera.fy)
                / square
            + 2.0 * (by_across.z * across + by_down.z * down) / (square * z),
    }
}

/// Writes the gradient to the quaternion, from the gradient to its rotation matrix.
#[cube]
fn rotation_backward(projection: &Projection, to: &Mat3, to_rows: &mut [f32], i: usize) {
    let w = projection.w;
    let q = projection.xyz;
    // ∂L/∂q̂ₖ = Σ ∂L/∂Rᵢⱼ ∂Rᵢⱼ/∂q̂ₖ (3DGS, appendix A)
    let to_w = 2.0 * (q.x * (to.z.y - to.y.z) + q.y * (to.x.z - to.z.x) + q.z * (to.y.x - to.x.y));
    let to_q = Vec3 {
        x: 2.0
            * (q.y * (to.x.y + to.y.x) + q.z * (to.x.z + to.z.x) + w * (to.z.y - to.y.z)
                - 2.0 * q.x * (to.y.y + to.z.z)),
        y: 2.0
            * (q.x * (to.x.y + to.y.x) + q.z * (to.y.z + to.z.y) + w * (to.x.z - to.z.x)
                - 2.0 * q.y * (to.x.x + to.z.z)),
        z: 2.0
            * (q.x * (to.x.z + to.z.x) + q.y * (to.y.z + to.z.y) + w * (to.y.x - to.x.y)
                - 2.0 * q.z * (to.x.x + to.y.y)),
    };
    // Of q̂ = q / |q|: (I − q̂ q̂ᵀ) ∂L/∂q̂ / |q|
    let along = to_w * w + dot(&to_q, &q);
    let inverse = 1.0 / max(projection.length, SHORTEST);
    to_rows[ROW * i + ROTATION] = (to_w - along * w) * inverse;
    let to_imaginary = plus(&to_q, &scaled(&q, -along));
    write(
        to_rows,
        ROW * i + ROTATION + 1,
        &scaled(&to_imaginary, inverse),
    );
}
