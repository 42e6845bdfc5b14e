//! The grid of motion weights: its box, the cells of points, and the support of a bone, the part of the box where
//! it has weights.

use rayon::prelude::*;

/// The canonical box that the motion weights fill, nodes at both ends of each axis.
#[derive(Clone, Debug, PartialEq)]
pub struct WarpGrid {
    /// Smallest corner, metres, x y z.
    pub min: [f32; 3],
    /// Largest corner, metres.
    pub max: [f32; 3],
    /// Nodes along x, y and z, at least 2 each.
    pub nodes: [usize; 3],
    /// Cells where all weights of a bone are at most this value may be left out: the bone's effect there is
    /// negligible. 0 leaves out nothing.
    pub floor: f32,
}

impl WarpGrid {
    /// Cells per metre along each axis.
    pub fn scale(&self) -> [f32; 3] {
        std::array::from_fn(|a| (self.nodes[a] - 1) as f32 / (self.max[a] - self.min[a]))
    }

    /// Number of nodes.
    pub fn voxels(&self) -> usize {
        self.nodes.iter().product()
    }

    /// [`Self::nodes`] as signed integers, as the indices of cells outside the box are.
    pub(super) fn sides(&self) -> [i32; 3] {
        self.nodes.map(|count| count as i32)
    }
}

/// The box outside which a bone's weight is at most the grid's floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Support {
    pub min: [f32; 3],
    pub max: [f32; 3],
}

impl Support {
    #[inline(always)]
    pub(super) fn contains(&self, p: [f32; 3]) -> bool {
        // Comparisons are false for a NaN.
        (0..3).all(|a| p[a] > self.min[a] && p[a] < self.max[a])
    }
}

/// The support of each of the first `bones` volumes, canonical metres: the box of the nodes above
/// the floor, and one cell more on each side.
pub(super) fn supports(weights: &[f32], bones: usize, grid: &WarpGrid) -> Vec<Support> {
    let [across, down, _] = grid.nodes;
    let scale = grid.scale();
    weights
        .par_chunks_exact(grid.voxels())
        .take(bones)
        .map(|volume| {
            let (mut low, mut high) = (grid.nodes, [0usize; 3]);
            for (row, line) in volume.chunks_exact(across).enumerate() {
                // Most lines are empty, and the compiler vectorizes this loop.
                if !line.iter().fold(false, |any, w| any | (*w > grid.floor)) {
                    continue;
                }
                let above = |w: &f32| *w > grid.floor;
                let (first, last) = line
                    .iter()
                    .position(above)
                    .zip(line.iter().rposition(above))
                    .expect("a node above the floor in this line");
                let (y, z) = (row % down, row / down);
                for (a, (from, to)) in [(first, last), (y, y), (z, z)].into_iter().enumerate() {
                    low[a] = low[a].min(from);
                    high[a] = high[a].max(to);
                }
            }
            Support {
                min: std::array::from_fn(|a| grid.min[a] + (low[a] as f32 - 1.0) / scale[a]),
                max: std::array::from_fn(|a| grid.min[a] + (high[a] as f32 + 1.0) / scale[a]),
            }
        })
        .collect()
}

/// A point in a cell of the grid.
pub(super) struct Cell {
    /// Lowest node of the cell, from −1.
    low: [i32; 3],
    /// Offset from that node, cells.
    part: [f32; 3],
}

impl Cell {
    /// The cell of point `p`, or `None` more than one cell outside the box, where all weights are
    /// zero.
    #[inline(always)]
    pub(super) fn of(p: [f32; 3], min: [f32; 3], scale: [f32; 3], sides: [i32; 3]) -> Option<Self> {
        let mut low = [0i32; 3];
        let mut part = [0f32; 3];
        for a in 0..3 {
            let g = (p[a] - min[a]) * scale[a];
            if !(g > -1.0 && g < sides[a] as f32) {
                return None;
            }
            // The floor of numbers above −1, without a call into the C library.
            low[a] = (g + 1.0) as i32 - 1;
            part[a] = g - low[a] as f32;
        }
        Some(Self { low, part })
    }

    /// The cell of point `p`, whose eight nodes are all inside the box; `None` outside the box. Points at its border
    /// are inside.
    #[inline(always)]
    pub(super) fn inside(
        p: [f32; 3],
        min: [f32; 3],
        scale: [f32; 3],
        sides: [i32; 3],
    ) -> Option<Self> {
        let mut low = [0i32; 3];
        let mut part = [0f32; 3];
        for a in 0..3 {
            let g = (p[a] - min[a]) * scale[a];
            // Comparisons are false for a NaN.
            if !(g >= 0.0 && g <= (sides[a] - 1) as f32) {
                return None;
            }
            low[a] = (g as i32).min(sides[a] - 2);
            part[a] = g - low[a] as f32;
        }
        Some(Self { low, part })
    }

    /// Calls `visit` for each of the eight nodes that is inside the box, with the node's index,
    /// its trilinear weight and the derivatives of that weight with respect to the offset along x, y, z.
    #[inline(always)]
    pub(super) fn taps(&self, sides: [i32; 3], mut visit: impl FnMut(usize, f32, [f32; 3])) {
        for corner in 0..8 {
            let bit = [corner & 1, corner >> 1 & 1, corner >> 2];
            let node: [i32; 3] = std::array::from_fn(|a| self.low[a] + bit[a]);
            if (0..3).any(|a| node[a] < 0 || node[a] >= sides[a]) {
                continue;
            }
            // The weight is u₀ u₁ u₂ with uₐ = part or 1 − part, whose derivative is ±1.
            let u: [f32; 3] = std::array::from_fn(|a| {
                if bit[a] == 1 {
                    self.part[a]
                } else {
                    1.0 - self.part[a]
                }
            });
            let s: [f32; 3] = std::array::from_fn(|a| if bit[a] == 1 { 1.0 } else { -1.0 });
            let index = ((node[2] * sides[1] + node[1]) * sides[0] + node[0]) as usize;
            visit(
                index,
                u[0] * u[1] * u[2],
                [s[0] * u[1] * u[2], u[0] * s[1] * u[2], u[0] * u[1] * s[2]],
            );
        }
    }

    /// The index of the cell's lowest node, and the distances between indices of neighbours along
    /// y and z, if all eight nodes are inside the box.
    #[inline(always)]
    fn inner(&self, sides: [i32; 3]) -> Option<(usize, usize, usize)> {
        let [i, j, k] = self.low;
        let inside =
            i >= 0 && j >= 0 && k >= 0 && i < sides[0] - 1 && j < sides[1] - 1 && k < sides[2] - 1;
        let (row, slab) = (sides[0] as usize, (sides[0] * sides[1]) as usize);
        inside.then(|| (k as usize * slab + j as usize * row + i as usize, row, slab))
    }

    /// Adds `to_value` to the nodes of the cell in proportion to their trilinear weights, and returns the
    /// derivatives of the volume with respect to the offset along x, y, z.
    #[inline(always)]
    pub(super) fn spread(
        &self,
        volume: &[f32],
        to_volume: &mut [f32],
        to_value: f32,
        sides: [i32; 3],
    ) -> [f32; 3] {
        let mut slope = [0f32; 3];
        if let Some((first, row, slab)) = self.inner(sides) {
            let cell = &volume[first..][..slab + row + 2];
            let to = &mut to_volume[first..][..slab + row + 2];
            let [x, y, z] = self.part;
            for (offset, sy, sz) in [
                (0, -1.0, -1.0),
                (row, 1.0, -1.0),
                (slab, -1.0, 1.0),
                (slab + row, 1.0, 1.0),
            ] {
                let uy = if sy > 0.0 { y } else { 1.0 - y };
                let uz = if sz > 0.0 { z } else { 1.0 - z };
                let share = to_value * uy * uz;
                to[offset] += share * (1.0 - x);
                to[offset + 1] += share * x;
                let (one, other) = (cell[offset], cell[offset + 1]);
                let value = one + x * (other - one);
                slope[0] += uy * uz * (other - one);
                slope[1] += sy * uz * value;
                slope[2] += sz * uy * value;
            }
            return slope;
        }
        self.taps(sides, |index, share, by_offset| {
            to_volume[index] += share * to_value;
            for a in 0..3 {
                slope[a] += by_offset[a] * volume[index];
            }
        });
        slope
    }

    /// The derivatives of the volume with respect to the offset along x, y, z.
    pub(super) fn slope(&self, volume: &[f32], sides: [i32; 3]) -> [f32; 3] {
        let mut slope = [0f32; 3];
        self.taps(sides, |index, _, by_offset| {
            for a in 0..3 {
                slope[a] += by_offset[a] * volume[index];
            }
        });
        slope
    }

    /// The volume's value here; nodes outside the box count as zero.
    #[inline(always)]
    pub(super) fn sample(&self, volume: &[f32], sides: [i32; 3]) -> f32 {
        if let Some((first, row, slab)) = self.inner(sides) {
            let cell = &volume[first..][..slab + row + 2];
            let [x, y, z] = self.part;
            // Linear interpolation along x, then y, then z.
            let line = |o: usize| cell[o] + x * (cell[o + 1] - cell[o]);
            let plane = |o: usize| line(o) + y * (line(o + row) - line(o));
            return plane(0) + z * (plane(slab) - plane(0));
        }
        let mut sum = 0.0;
        self.taps(sides, |index, share, _| sum += share * volume[index]);
        sum
    }
}
