//! The splats of each tile of the picture, near to far.

use super::projected::Projected;
use rayon::prelude::*;

/// Side of a tile, pixels.
pub(super) const SIDE: usize = 16;
/// Pixels of a tile.
pub(super) const AREA: usize = SIDE * SIDE;

/// Lists of splats by tile, row by row.
pub(super) struct Tiles {
    /// Tiles per row.
    pub across: usize,
    /// `[T + 1]`: the splats of tile t are entries `starts[t]..starts[t + 1]`.
    pub starts: Vec<usize>,
    /// Indices of the splats, near to far in each tile.
    pub entries: Vec<u32>,
}

impl Tiles {
    /// The tiles of a picture of `width` x `height` pixels.
    pub fn new(projected: &[Projected], width: usize, height: usize) -> Self {
        let (across, down) = Self::sides(width, height);
        // Depths are positive, so their bits have the same order; the index settles ties.
        let mut order: Vec<(u32, u32)> = (0..)
            .zip(projected)
            .filter(|(_, splat)| splat.opacity > 0.0)
            .map(|(index, splat)| (splat.depth.to_bits(), index))
            .collect();
        order.par_sort_unstable();
        let mut starts = vec![0usize; across * down + 1];
        for (_, index) in &order {
            for tile in overlapped(&projected[*index as usize], across, down) {
                starts[tile + 1] += 1;
            }
        }
        for tile in 0..across * down {
            starts[tile + 1] += starts[tile];
        }
        let mut next = starts.clone();
        let mut entries = vec![0u32; starts[across * down]];
        for (_, index) in &order {
            for tile in overlapped(&projected[*index as usize], across, down) {
                entries[next[tile]] = *index;
                next[tile] += 1;
            }
        }
        Self {
            across,
            starts,
            entries,
        }
    }

    /// Tiles per row and per column of a picture of `width` x `height` pixels.
    pub fn sides(width: usize, height: usize) -> (usize, usize) {
        (width.div_ceil(SIDE), height.div_ceil(SIDE))
    }

    /// Number of tiles.
    pub fn count(&self) -> usize {
        self.starts.len() - 1
    }

    /// The splats of a tile, near to far.
    pub fn of(&self, tile: usize) -> &[u32] {
        &self.entries[self.starts[tile]..self.starts[tile + 1]]
    }

    /// Column and row of a tile's first pixel.
    pub fn corner(&self, tile: usize) -> [usize; 2] {
        [tile % self.across * SIDE, tile / self.across * SIDE]
    }
}

/// The tiles that the rectangle around a splat overlaps.
fn overlapped(splat: &Projected, across: usize, down: usize) -> impl Iterator<Item = usize> {
    let range = |a: usize, count: usize| {
        let first = ((splat.centre[a] - splat.extent[a]) / SIDE as f32).floor();
        let last = ((splat.centre[a] + splat.extent[a]) / SIDE as f32).floor();
        // Comparisons are false for a NaN, which overlaps nothing.
        if first < count as f32 && last >= 0.0 {
            first.max(0.0) as usize..(last as usize).saturating_add(1).min(count)
        } else {
            0..0
        }
    };
    let columns = range(0, across);
    range(1, down).flat_map(move |row| columns.clone().map(move |column| row * across + column))
}
