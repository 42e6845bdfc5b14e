//! Inside a kernel: the pixels of a thread, and what a splat is to them. A group of threads has a tile,
//! each thread a strip of a row: one reading of a splat serves all pixels of the strip.

use super::super::tiles::{AREA, SIDE};
use super::super::{LEAST, MOST};
use super::flatten::FLAT;
use cubecl::prelude::*;

/// Pixels of a strip.
pub(super) const STRIP: usize = 4;
/// Threads of a group. Every Vulkan device runs as many.
pub(super) const THREADS: usize = AREA / STRIP;

/// A strip of the picture.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Strip {
    /// Number of the tile, row by row.
    pub tile: usize,
    /// Number of the first pixel, row by row.
    pub first: usize,
    /// Pixels that the picture has, from the first on.
    pub count: usize,
    /// Middle of the first pixel.
    pub x: f32,
    pub y: f32,
}

/// The strip of this thread in a picture of `width` x `height` pixels.
#[cube]
pub(super) fn strip(width: usize, height: usize) -> Strip {
    let unit = UNIT_POS as usize;
    let column = CUBE_POS_X as usize * SIDE + unit % (SIDE / STRIP) * STRIP;
    let row = CUBE_POS_Y as usize * SIDE + unit / (SIDE / STRIP);
    let mut count = 0usize;
    if row < height && column < width {
        count = min(width - column, STRIP);
    }
    Strip {
        tile: CUBE_POS_Y as usize * (CUBE_COUNT_X as usize) + CUBE_POS_X as usize,
        first: row * width + column,
        count,
        x: f32::cast_from(column) + 0.5,
        y: f32::cast_from(row) + 0.5,
    }
}

/// 1 for each pixel that the picture has, 0 for others, which are finished from the beginning.
#[cube]
pub(super) fn unhidden(strip: &Strip) -> Array<f32> {
    let mut through = Array::<f32>::new(STRIP);
    #[unroll]
    for p in 0..STRIP {
        through[p] = 0.0;
        if p < strip.count {
            through[p] = 1.0;
        }
    }
    through
}

/// The largest transmittance.
#[cube]
pub(super) fn clearest(through: &Array<f32>) -> f32 {
    let mut most = 0.0f32;
    #[unroll]
    for p in 0..STRIP {
        most = max(most, through[p]);
    }
    most
}

/// A splat as seen from a strip.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Near {
    /// Whether it may reach any of the strip's pixels.
    pub reaches: bool,
    /// From its centre to the first pixel.
    pub dx: f32,
    pub dy: f32,
    /// Inverse covariance.
    pub xx: f32,
    pub xy: f32,
    pub yy: f32,
    /// At its centre.
    pub opacity: f32,
    pub red: f32,
    pub green: f32,
    pub blue: f32,
}

/// The splat number `splat` of `flats`.
#[cube]
pub(super) fn near(flats: &[f32], splat: usize, strip: &Strip) -> Near {
    let at = FLAT * splat;
    let dx = strip.x - flats[at];
    let dy = strip.y - flats[at + 1];
    let reach = flats[at + 10];
    let last = dx + (STRIP - 1) as f32;
    let beside = dx > reach || -last > reach;
    Near {
        reaches: !beside && f32::abs(dy) <= flats[at + 11],
        dx,
        dy,
        xx: flats[at + 2],
        xy: flats[at + 3],
        yy: flats[at + 4],
        opacity: flats[at + 5],
        red: flats[at + 6],
        green: flats[at + 7],
        blue: flats[at + 8],
    }
}

/// Its opacity at a pixel `dx` to the right of its centre; 0 where it is less than [`LEAST`].
#[cube]
pub(super) fn opacity_at(near: &Near, dx: f32) -> f32 {
    let power =
        -0.5f32 * (near.xx * dx * dx + 2.0 * near.xy * dx * near.dy + near.yy * near.dy * near.dy);
    let mut alpha = min(
        near.opacity * f32::exp(clamp(power, -20.0f32, 0.0f32)),
        MOST,
    );
    if alpha < LEAST {
        alpha = 0.0;
    }
    alpha
}
