//! The kernel that carries gradients from the picture to the splats' own numbers and the light: a thread
//! per splat. The counterpart of `unflatten` in `flat`.

use super::super::ROW;
use super::super::light::LIGHTS;
use super::lift::{Camera, Lifted, camera, lift, light_terms, shade};
use super::unblend::SUMS;
use super::vectors::{
    Mat3, Vec3, by_axis, carried, carried_back, dot, mixed, plus, plus_outer, product, read,
    scaled, stretched, transposed, write,
};
use crate::cube::adding::{AddFloat, Bound};
use cubecl::prelude::*;

/// Threads of a group, which sum the gradient to the light before it is added to that of other groups.
pub(super) const GROUP: usize = 64;
/// Numbers of the light.
const ALL_LIGHTS: usize = 3 * LIGHTS;

/// Gradients `to_transforms` `[N, 12]`, `to_rows` `[N, 14]` and, added, `to_light` `[3, 8]`, from the
/// sums `to_splats` `[N, 9]` of [`unblend_tiles`](super::unblend::unblend_tiles).
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
pub(super) fn unflatten_splats<A: AddFloat>(
    transforms: &[f32],
    rows: &[f32],
    light: &[f32],
    sight: &[f32],
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
        let camera = camera(sight);
        let lifted = lift(transforms, rows, i, &camera);
        if lifted.visible {
            let sums = SUMS * i;
            let to_colour = read(to_splats, sums);
            let to_normal =
                pull_light(light, &camera, &lifted, &to_colour, to_rows, i, &mut shared);
            pull_shape(
                &camera,
                &lifted,
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

/// Writes the gradients to colour and light, and returns that to the normal in the body frame before
/// its length is 1.
#[cube]
fn pull_light(
    light: &[f32],
    camera: &Camera,
    lifted: &Lifted,
    to_colour: &Vec3,
    to_rows: &mut [f32],
    i: usize,
    shared: &mut Shared<[f32]>,
) -> Vec3 {
    let unit = UNIT_POS as usize;
    let n = lifted.world;
    let terms = light_terms(&n);
    let to_shade = by_axis(to_colour, &lifted.colour);
    let shades = Vec3 {
        x: shade(light, 0usize, &terms),
        y: shade(light, 1usize, &terms),
        z: shade(light, 2usize, &terms),
    };
    write(to_rows, ROW * i + 11, &by_axis(to_colour, &shades));
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
    let to_world = Vec3 {
        x: to[0usize] + to[3usize] * n.y + to[5usize] * n.z + 2.0 * to[6usize] * n.x,
        y: to[1usize] + to[3usize] * n.x + to[4usize] * n.z - 2.0 * to[6usize] * n.y,
        z: to[2usize] + to[4usize] * n.y + to[5usize] * n.x + 6.0 * to[7usize] * n.z,
    };
    let turned = carried_back(&camera.world, &to_world);
    let along = dot(&turned, &lifted.normal);
    let inverse = 1.0 / lifted.normal_length;
    mixed(inverse, &turned, -along * inverse, &lifted.normal)
}

/// Writes the gradients to everything else.
#[cube]
fn pull_shape(
    camera: &Camera,
    lifted: &Lifted,
    to_splats: &[f32],
    to_normal: &Vec3,
    to_transforms: &mut [f32],
    to_rows: &mut [f32],
    i: usize,
) {
    let sums = SUMS * i;
    let (xx, xy, yy) = (lifted.xx, lifted.xy, lifted.yy);
    // The exponent is −(xx dx² + 2 xy dx dy + yy dy²) / 2, and opacity is o times its exponential.
    let to_power = to_splats[sums + 3];
    let u = xx * to_splats[sums + 4] + xy * to_splats[sums + 5];
    let v = xy * to_splats[sums + 4] + yy * to_splats[sums + 5];
    let to_xx = -0.5f32 * to_splats[sums + 6];
    let to_xy = -0.5f32 * to_splats[sums + 7];
    let to_yy = -0.5f32 * to_splats[sums + 8];
    to_rows[ROW * i + 10] = to_power * (1.0 - lifted.opacity);

    // J E A R S, of which the covariance is the square: dΣ = −Σ⁻¹ d(Σ⁻¹) Σ⁻¹.
    let across_x = xx * to_xx + xy * to_xy;
    let across_y = xx * to_xy + xy * to_yy;
    let down_x = xy * to_xx + yy * to_xy;
    let down_y = xy * to_xy + yy * to_yy;
    let cov_xx = across_x * xx + across_y * xy;
    let cov_xy = across_x * xy + across_y * yy;
    let cov_yx = down_x * xx + down_y * xy;
    let cov_yy = down_x * xy + down_y * yy;
    let to_across = mixed(
        -2.0f32 * cov_xx,
        &lifted.flat_across,
        -2.0f32 * cov_xy,
        &lifted.flat_down,
    );
    let to_down = mixed(
        -2.0f32 * cov_yx,
        &lifted.flat_across,
        -2.0f32 * cov_yy,
        &lifted.flat_down,
    );
    let to_at = pull_projection(camera, lifted, u, v, &to_across, &to_down);
    let to_axes = Mat3 {
        x: mixed(lifted.across.x, &to_across, lifted.down.x, &to_down),
        y: mixed(lifted.across.y, &to_across, lifted.down.y, &to_down),
        z: mixed(lifted.across.z, &to_across, lifted.down.z, &to_down),
    };

    // To E A, and on to A.
    let by_scales = stretched(&lifted.turn, &lifted.deviations);
    let to_linear = product(&to_axes, &transposed(&by_scales));
    let to_linear = plus_outer(&to_linear, &to_at, &lifted.mean);
    let to_own = product(&transposed(&camera.turn), &to_linear);
    let to_own = plus_outer(&to_own, to_normal, &lifted.outward);
    let to_shift = carried_back(&camera.turn, &to_at);
    write(to_transforms, 12 * i, &to_own.x);
    write(to_transforms, 12 * i + 4, &to_own.y);
    write(to_transforms, 12 * i + 8, &to_own.z);
    to_transforms[12 * i + 3] = to_shift.x;
    to_transforms[12 * i + 7] = to_shift.y;
    to_transforms[12 * i + 11] = to_shift.z;

    // To R S, and on to both.
    let back = transposed(&lifted.linear);
    write(to_rows, ROW * i, &carried(&back, &to_at));
    let to_scaled = product(&back, &to_axes);
    let turn = &lifted.turn;
    let along = plus(
        &plus(
            &by_axis(&to_scaled.x, &turn.x),
            &by_axis(&to_scaled.y, &turn.y),
        ),
        &by_axis(&to_scaled.z, &turn.z),
    );
    write(to_rows, ROW * i + 7, &by_axis(&along, &lifted.deviations));
    let outward = carried_back(&lifted.own, to_normal);
    let to_turn = stretched(&to_scaled, &lifted.deviations);
    let third = Vec3 {
        x: 0.0f32,
        y: 0.0f32,
        z: 1.0f32,
    };
    pull_rotation(lifted, &plus_outer(&to_turn, &outward, &third), to_rows, i);
}

/// Gradient to the place in the camera's frame, through the centre and the Jacobian.
#[cube]
fn pull_projection(
    camera: &Camera,
    lifted: &Lifted,
    u: f32,
    v: f32,
    to_across: &Vec3,
    to_down: &Vec3,
) -> Vec3 {
    let z = lifted.depth;
    let square = z * z;
    let across = camera.fx * lifted.at.x + camera.skew * lifted.at.y;
    let down = camera.fy * lifted.at.y;
    let by_across = carried(&lifted.axes, to_across);
    let by_down = carried(&lifted.axes, to_down);
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

/// Writes the gradient to the quaternion, from that to its rotation.
#[cube]
fn pull_rotation(lifted: &Lifted, to: &Mat3, to_rows: &mut [f32], i: usize) {
    let w = lifted.w;
    let q = lifted.xyz;
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
    let along = to_w * w + dot(&to_q, &q);
    let inverse = 1.0 / max(lifted.length, f32::MIN_POSITIVE);
    to_rows[ROW * i + 3] = (to_w - along * w) * inverse;
    let to_imaginary = plus(&to_q, &scaled(&q, -along));
    write(to_rows, ROW * i + 4, &scaled(&to_imaginary, inverse));
}
