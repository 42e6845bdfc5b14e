//! The kernel that blends the splats of each tile, near to far.

use super::super::raster::OPAQUE;
use super::strip::{STRIP, clearest, near, opacity_at, strip, unhidden};
use cubecl::prelude::*;

/// `picture` `[H W, 4]`, colour over black and opacity, of the splats `flats` `[N, 12]`: those of tile t
/// are `entries[starts[t]..starts[t + 1]]`. A group of threads for each tile.
///
/// A strip ends by itself at a transmittance of [`OPAQUE`], where the CPU ends the whole tile: the
/// difference is at most that.
#[cube(launch)]
pub(super) fn blend_tiles(
    flats: &[f32],
    starts: &[u32],
    entries: &[u32],
    picture: &mut [f32],
    width: usize,
    height: usize,
) {
    let strip = strip(width, height);
    let mut through = unhidden(&strip);
    let mut sums = Array::<f32>::new(4 * STRIP);
    #[unroll]
    for k in 0..4 * STRIP {
        sums[k] = 0.0;
    }
    let end = starts[strip.tile + 1] as usize;
    let mut entry = starts[strip.tile] as usize;
    while entry < end {
        let near = near(flats, entries[entry] as usize, &strip);
        entry += 1;
        if near.reaches {
            #[unroll]
            for p in 0..STRIP {
                let weight = through[p] * opacity_at(&near, near.dx + p as f32);
                sums[4 * p] += weight * near.red;
                sums[4 * p + 1] += weight * near.green;
                sums[4 * p + 2] += weight * near.blue;
                sums[4 * p + 3] += weight;
                through[p] -= weight;
            }
        }
        if clearest(&through) < OPAQUE {
            entry = end;
        }
    }
    #[unroll]
    for p in 0..STRIP {
        if p < strip.count {
            #[unroll]
            for c in 0..4usize {
                picture[4 * (strip.first + p) + c] = sums[4 * p + c];
            }
        }
    }
}
