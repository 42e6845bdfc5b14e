//! Inside a kernel: the pixels of a thread, and the projected splat that it blends. A group of threads has a
//! tile, each thread a segment of a tile row: one read of a splat serves all pixels of the segment.

use super::super::tiles::{AREA, SIDE};
use super::super::{MAX_ALPHA, MIN_ALPHA};
use super::project::PROJECTED_ROW;
use cubecl::prelude::*;

/// Pixels per segment of a tile row.
pub(super) const SEGMENT: usize = 4;
/// Threads per group; every Vulkan device supports this many.
pub(super) const THREADS: usize = AREA / SEGMENT;

/// The segment of a tile row that a thread has.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Segment {
    /// Index of the tile, row by row.
    pub tile: usize,
    /// Index of the first pixel in the picture, row by row.
    pub first: usize,
    /// Number of pixels that are inside the picture, from the first on.
    pub count: usize,
    /// Centre of the first pixel.
    pub x: f32,
    pub y: f32,
}

/// The segment of this thread in a picture of `width` x `height` pixels.
#[cube]
pub(super) fn segment(width: usize, height: usize) -> Segment {
    let unit = UNIT_POS as usize;
    let column = CUBE_POS_X as usize * SIDE + unit % (SIDE / SEGMENT) * SEGMENT;
    let row = CUBE_POS_Y as usize * SIDE + unit / (SIDE / SEGMENT);
    let mut count = 0usize;
    if row < height && column < width {
        count = min(width - column, SEGMENT);
    }
    Segment {
        tile: CUBE_POS_Y as usize * (CUBE_COUNT_X as usize) + CUBE_POS_X as usize,
        first: row * width + column,
        count,
        x: f32::cast_from(column) + 0.5,
        y: f32::cast_from(row) + 0.5,
    }
}

/// Transmittance before the first splat: 1 for each pixel inside the picture, 0 for others, which are finished
/// from the beginning.
#[cube]
pub(super) fn initial_transmittance(segment: &Segment) -> Array<f32> {
    let mut transmittance = Array::<f32>::new(SEGMENT);
    #[unroll]
    for p in 0..SEGMENT {
        transmittance[p] = 0.0;
        if p < segment.count {
            transmittance[p] = 1.0;
        }
    }
    transmittance
}

/// The largest transmittance of the segment's pixels.
#[cube]
pub(super) fn max_transmittance(transmittance: &Array<f32>) -> f32 {
    let mut most = 0.0f32;
    #[unroll]
    for p in 0..SEGMENT {
        most = max(most, transmittance[p]);
    }
    most
}

/// A projected splat in registers, with its offset to a segment.
#[derive(CubeType, Clone, Copy)]
pub(super) struct LoadedSplat {
    /// Whether its extent covers any of the segment's pixels.
    pub reaches: bool,
    /// Offset from its centre to the first pixel's, pixels.
    pub dx: f32,
    pub dy: f32,
    /// Inverse covariance, the conic.
    pub xx: f32,
    pub xy: f32,
    pub yy: f32,
    /// Opacity at its centre.
    pub opacity: f32,
    pub red: f32,
    pub green: f32,
    pub blue: f32,
}

/// Reads the splat with the index `splat` from `projected` `[N, 12]`.
#[cube]
pub(super) fn load_splat(projected: &[f32], splat: usize, segment: &Segment) -> LoadedSplat {
    let at = PROJECTED_ROW * splat;
    let dx = segment.x - projected[at];
    let dy = segment.y - projected[at + 1];
    let extent = projected[at + 10];
    let last = dx + (SEGMENT - 1) as f32;
    let beside = dx > extent || -last > extent;
    LoadedSplat {
        reaches: !beside && f32::abs(dy) <= projected[at + 11],
        dx,
        dy,
        xx: projected[at + 2],
        xy: projected[at + 3],
        yy: projected[at + 4],
        opacity: projected[at + 5],
        red: projected[at + 6],
        green: projected[at + 7],
        blue: projected[at + 8],
    }
}

/// Opacity α of a splat at a pixel that is `dx` to the right of its centre; 0 where it is less than [`MIN_ALPHA`].
#[cube]
pub(super) fn alpha_at(splat: &LoadedSplat, dx: f32) -> f32 {
    // α = min(o exp(−(xx dx² + 2 xy dx dy + yy dy²) / 2), MAX_ALPHA) (3DGS, eq. 4)
    let power = -0.5f32
        * (splat.xx * dx * dx + 2.0 * splat.xy * dx * splat.dy + splat.yy * splat.dy * splat.dy);
    let mut alpha = min(
        splat.opacity * f32::exp(clamp(power, -20.0f32, 0.0f32)),
        MAX_ALPHA,
    );
    if alpha < MIN_ALPHA {
        alpha = 0.0;
    }
    alpha
}
