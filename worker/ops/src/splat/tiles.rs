//! The splats of each tile of the picture, near to far.

use super::projected::Projected;
use rayon::prelude::*;
use std::ops::Range;

/// Side of a tile, pixels.
pub(super) const SIDE: usize = 16;
/// Splats per task.
const BLOCK: usize = 512;
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
    pub(super) fn new(projected: &[Projected], width: usize, height: usize) -> Self {
        let (across, down) = Self::sides(width, height);
        // Depths are positive, so their bits have the same order; the index settles ties.
        let mut order: Vec<(u32, u32, Overlap)> = projected
            .par_iter()
            .enumerate()
            .with_min_len(BLOCK)
            .filter(|(_, splat)| splat.opacity > 0.0)
            .map(|(index, splat)| {
                let overlap = Overlap::of(splat, across, down);
                (splat.depth.to_bits(), index as u32, overlap)
            })
            .collect();
        order.par_sort_unstable_by_key(|(depth, index, _)| (*depth, *index));
        let mut in_row = vec![Vec::new(); down];
        for (_, index, overlap) in &order {
            for row in overlap.rows.clone() {
                in_row[row as usize].push((*index, overlap.columns.clone()));
            }
        }
        let rows: Vec<Row> = in_row
            .par_iter()
            .map(|splats| Row::of(splats, across))
            .collect();
        let mut starts = Vec::with_capacity(across * down + 1);
        let mut entries = Vec::with_capacity(rows.iter().map(|row| row.entries.len()).sum());
        for row in &rows {
            starts.extend(row.starts.iter().map(|start| entries.len() + start));
            entries.extend_from_slice(&row.entries);
        }
        starts.push(entries.len());
        Self {
            across,
            starts,
            entries,
        }
    }

    /// Tiles per row and per column of a picture of `width` x `height` pixels.
    pub(super) fn sides(width: usize, height: usize) -> (usize, usize) {
        (width.div_ceil(SIDE), height.div_ceil(SIDE))
    }

    /// Number of tiles.
    pub(super) fn count(&self) -> usize {
        self.starts.len() - 1
    }

    /// The splats of a tile, near to far.
    pub(super) fn of(&self, tile: usize) -> &[u32] {
        &self.entries[self.starts[tile]..self.starts[tile + 1]]
    }

    /// Column and row of a tile's first pixel.
    pub(super) fn corner(&self, tile: usize) -> [usize; 2] {
        [tile % self.across * SIDE, tile / self.across * SIDE]
    }
}

/// The columns and rows of tiles that the rectangle around a splat overlaps.
#[derive(Clone, Debug)]
struct Overlap {
    columns: Range<u32>,
    rows: Range<u32>,
}

impl Overlap {
    fn of(splat: &Projected, across: usize, down: usize) -> Self {
        let range = |a: usize, count: usize| {
            let first = ((splat.centre[a] - splat.extent[a]) / SIDE as f32).floor();
            let last = ((splat.centre[a] + splat.extent[a]) / SIDE as f32).floor();
            // Comparisons are false for a NaN, which overlaps nothing.
            if first < count as f32 && last >= 0.0 {
                first.max(0.0) as u32..(last as u32).saturating_add(1).min(count as u32)
            } else {
                0..0
            }
        };
        Self {
            columns: range(0, across),
            rows: range(1, down),
        }
    }
}

/// The lists of one row of tiles.
struct Row {
    /// First entry of each tile.
    starts: Vec<usize>,
    entries: Vec<u32>,
}

impl Row {
    /// The lists of a row of `across` tiles, of `splats` near to far, each with the columns that it overlaps.
    fn of(splats: &[(u32, Range<u32>)], across: usize) -> Self {
        let mut starts = vec![0usize; across + 1];
        for column in splats.iter().flat_map(|(_, columns)| columns.clone()) {
            starts[column as usize + 1] += 1;
        }
        for column in 0..across {
            starts[column + 1] += starts[column];
        }
        let mut next = starts.clone();
        let mut entries = vec![0u32; starts[across]];
        for (index, columns) in splats {
            for column in columns.clone().map(|it| it as usize) {
                entries[next[column]] = *index;
                next[column] += 1;
            }
        }
        starts.pop();
        Self { starts, entries }
    }
}
