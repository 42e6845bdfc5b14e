//! The kernel that projects splats: a thread per splat.

use super::super::MIN_ALPHA;
use super::super::projected::{LARGEST_EXTENT, Projected};
use super::projection::{camera, light_terms, projection, shade};
use super::vectors::Vec3;
use cubecl::prelude::*;

/// Numbers per [`Projected`] in the kernels' buffer: centre, conic, opacity, colour, depth, extent.
pub(super) const PROJECTED_ROW: usize = 12;

/// The [`Projected`] of numbers that the kernel wrote.
pub(super) fn of_numbers(numbers: &[f32; PROJECTED_ROW]) -> Projected {
    let [u, v, xx, xy, yy, opacity, red, green, blue, depth, x, y] = *numbers;
    Projected {
        centre: [u, v],
        conic: [xx, xy, yy],
        opacity,
        colour: [red, green, blue],
        depth,
        extent: [x, y],
    }
}

/// Writes the projected splats `[N, 12]`; those that are not visible have zeros.
#[cube(launch)]
pub(super) fn project_splats(
    transforms: &[f32],
    rows: &[f32],
    light: &[f32],
    view: &[f32],
    projected: &mut [f32],
) {
    let i = ABSOLUTE_POS;
    if i >= projected.len() / PROJECTED_ROW {
        terminate!();
    }
    let camera = camera(view);
    let projection = projection(transforms, rows, i, &camera);
    let to = PROJECTED_ROW * i;
    if projection.visible {
        let z = projection.depth;
        let mean = projection.camera_mean;
        // The opacity o exp(−q / 2) is MIN_ALPHA where q = dᵀ Σ'⁻¹ d = 2 ln(o / MIN_ALPHA); that ellipse reaches
        // √(q Σ'xx) along x.
        let edge = 2.0 * f32::ln(projection.opacity / MIN_ALPHA);
        let (xx, xy, yy) = (projection.xx, projection.xy, projection.yy);
        let terms = light_terms(&projection.world_normal);
        let colour = Vec3 {
            x: projection.colour.x * shade(light, 0usize, &terms),
            y: projection.colour.y * shade(light, 1usize, &terms),
            z: projection.colour.z * shade(light, 2usize, &terms),
        };
        projected[to] = (camera.fx * mean.x + camera.skew * mean.y) / z + camera.cx;
        projected[to + 1] = camera.fy * mean.y / z + camera.cy;
        projected[to + 2] = xx;
        projected[to + 3] = xy;
        projected[to + 4] = yy;
        projected[to + 5] = projection.opacity;
        projected[to + 6] = colour.x;
        projected[to + 7] = colour.y;
        projected[to + 8] = colour.z;
        projected[to + 9] = z;
        projected[to + 10] = min(f32::sqrt(edge * projection.cov_xx), LARGEST_EXTENT);
        projected[to + 11] = min(f32::sqrt(edge * projection.cov_yy), LARGEST_EXTENT);
    } else {
        #[unroll]
        for k in 0..PROJECTED_ROW {
            projected[to + k] = 0.0;
        }
    }
}
