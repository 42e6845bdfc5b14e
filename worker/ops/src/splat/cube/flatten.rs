//! The kernel that projects splats: a thread per splat.

use super::super::LEAST;
use super::super::flat::Flat;
use super::lift::{camera, lift, light_terms, shade};
use super::vectors::Vec3;
use cubecl::prelude::*;

/// Numbers of a [`Flat`] in the kernels' list: centre, conic, opacity, colour, depth, reach.
pub(super) const FLAT: usize = 12;

/// The [`Flat`] of numbers that the kernel wrote.
pub(super) fn of_numbers(numbers: &[f32; FLAT]) -> Flat {
    let [u, v, xx, xy, yy, opacity, red, green, blue, depth, x, y] = *numbers;
    Flat {
        centre: [u, v],
        conic: [xx, xy, yy],
        opacity,
        colour: [red, green, blue],
        depth,
        reach: [x, y],
    }
}

/// Splats in the picture, `[N, 12]`; those that can't be seen have zeros.
#[cube(launch)]
pub(super) fn flatten_splats(
    transforms: &[f32],
    rows: &[f32],
    light: &[f32],
    sight: &[f32],
    flats: &mut [f32],
) {
    let i = ABSOLUTE_POS;
    if i >= flats.len() / FLAT {
        terminate!();
    }
    let camera = camera(sight);
    let lifted = lift(transforms, rows, i, &camera);
    let to = FLAT * i;
    if lifted.visible {
        let z = lifted.depth;
        let at = lifted.at;
        // dᵀ Σ⁻¹ d at the edge.
        let edge = 2.0 * f32::ln(lifted.opacity / LEAST);
        let (xx, xy, yy) = (lifted.xx, lifted.xy, lifted.yy);
        let determinant = max(xx * yy - xy * xy, f32::MIN_POSITIVE);
        let terms = light_terms(&lifted.world);
        let colour = Vec3 {
            x: lifted.colour.x * shade(light, 0usize, &terms),
            y: lifted.colour.y * shade(light, 1usize, &terms),
            z: lifted.colour.z * shade(light, 2usize, &terms),
        };
        flats[to] = (camera.fx * at.x + camera.skew * at.y) / z + camera.cx;
        flats[to + 1] = camera.fy * at.y / z + camera.cy;
        flats[to + 2] = xx;
        flats[to + 3] = xy;
        flats[to + 4] = yy;
        flats[to + 5] = lifted.opacity;
        flats[to + 6] = colour.x;
        flats[to + 7] = colour.y;
        flats[to + 8] = colour.z;
        flats[to + 9] = z;
        flats[to + 10] = f32::sqrt(edge * yy / determinant);
        flats[to + 11] = f32::sqrt(edge * xx / determinant);
    } else {
        #[unroll]
        for k in 0..FLAT {
            flats[to + k] = 0.0;
        }
    }
}
