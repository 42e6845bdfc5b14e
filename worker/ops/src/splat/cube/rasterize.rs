//! The kernel that rasterizes: it blends the splats of each tile, near to far (3DGS, eq. 2 and 3).

use super::super::rasterize::OPAQUE;
use super::tile_row::{
    SEGMENT, alpha_at, initial_transmittance, load_splat, max_transmittance, segment,
};
use cubecl::prelude::*;

/// Writes `picture` `[H W, 4]`, colour over black and opacity, of the splats `projected` `[N, 12]`. The splats of
/// tile t are `entries[starts[t]..starts[t + 1]]`. There is a group of threads per tile.
///
/// A segment ends by itself at a transmittance of [`OPAQUE`], where the CPU ends the whole tile: the
/// difference is at most that.
#[cube(launch)]
pub(super) fn rasterize_tiles(
    projected: &[f32],
    starts: &[u32],
    entries: &[u32],
    picture: &mut [f32],
    width: usize,
    height: usize,
) {
    let segment = segment(width, height);
    let mut transmittance = initial_transmittance(&segment);
    let mut sums = Array::<f32>::new(4 * SEGMENT);
    #[unroll]
    for k in 0..4 * SEGMENT {
        sums[k] = 0.0;
    }
    let end = starts[segment.tile + 1] as usize;
    let mut entry = starts[segment.tile] as usize;
    while entry < end {
        let splat = load_splat(projected, entries[entry] as usize, &segment);
        entry += 1;
        if splat.reaches {
            #[unroll]
            for p in 0..SEGMENT {
                // C += T α c, then T ← T (1 − α)
                let weight = transmittance[p] * alpha_at(&splat, splat.dx + p as f32);
                sums[4 * p] += weight * splat.red;
                sums[4 * p + 1] += weight * splat.green;
                sums[4 * p + 2] += weight * splat.blue;
                sums[4 * p + 3] += weight;
                transmittance[p] -= weight;
            }
        }
        if max_transmittance(&transmittance) < OPAQUE {
            entry = end;
        }
    }
    #[unroll]
    for p in 0..SEGMENT {
        if p < segment.count {
            #[unroll]
            for c in 0..4usize {
                picture[4 * (segment.first + p) + c] = sums[4 * p + c];
            }
        }
    }
}
