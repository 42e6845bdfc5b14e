//! The occupancy grid of a person's canonical box: one opacity per cell, learned from the samples
//! of training, so that samples in empty cells need not be evaluated.
//!
//! A cell holds the opacity of one step through it, including the foreground likelihood: where
//! bones have little weight, no loss reduces the density. The opacity is stored as one byte of its
//! logarithm. Each training step that visits a cell lowers it by a few levels and raises it to the
//! largest opacity seen there, so cells become empty only after several visits. The result depends
//! neither on the order of a step's samples nor on the number of threads.
//!
//! Opacities are stored where the canonical field was evaluated: after the non-rigid offset, which
//! depends on the pose. Samples are looked up before the offset is known, so a cell counts as empty
//! only if all cells within the largest offset seen are empty.

use crate::config::MarchConfig;
use yoto_ops::composite::opacity;
use yoto_ops::warp::WarpGrid;

/// Levels are the leading bits of an f32: eight levels per power of two.
const SHIFT: u32 = 20;
/// Opacities up to 2⁻²⁰ have level 1.
const LOWEST: u32 = (127 - 20) << 3;
/// Levels that a cell loses with each step that visits it: about 30 % of its opacity.
const FORGET: u8 = 4;
/// Level of a cell that no sample has visited.
const NEVER: u8 = 0;
/// One in this many pairs of an empty cell and a training step is evaluated nevertheless, so that
/// cells can become occupied again.
const PROBES: u32 = 32;
/// How far canonical points may be from the blend that a search for them starts from, metres, beyond
/// the neighbours that count as occupied anyway: three quarters of those near the bones of people in
/// motion are within 3 cm (docs/research/quality.md).
const NEAR: f32 = 0.03;

/// Densities of a training step, from which the grid learns.
pub struct DensityObservations {
    /// `[n, 3]` canonical positions before the non-rigid offset, metres.
    pub canonical: Vec<f32>,
    /// `[n, 3]` canonical positions after the non-rigid offset, metres.
    pub moved: Vec<f32>,
    /// `[n]`, 1/m.
    pub densities: Vec<f32>,
    /// `[n]` foreground likelihoods.
    pub likelihoods: Vec<f32>,
}

/// One person's grid. Cells are cubes; x runs fastest, then y, z.
#[derive(Clone, Debug, PartialEq)]
pub struct Occupancy {
    min: [f32; 3],
    /// Cells per metre.
    scale: f32,
    cells: [usize; 3],
    /// Step length of the opacities, metres.
    step: f32,
    /// Lowest level of an occupied cell.
    bound: u8,
    levels: Vec<u8>,
    /// Largest non-rigid offset along an axis of a sample that was not empty, metres.
    reach: f32,
    /// One bit per cell, each row starting with a new word: whether an occupied cell is within
    /// [`Self::radius`] cells, or the cell was never visited.
    occupied: Vec<u64>,
    /// One bit per cell: whether it is within [`NEAR`] of a cell that counts as occupied.
    near: Vec<u64>,
}

impl Occupancy {
    /// A grid over the box of `grid` without any visited cells; `None` if `config` disables grids.
    pub fn new(grid: &WarpGrid, config: &MarchConfig) -> Option<Self> {
        if config.occupancy_cells == 0 || config.occupancy_alpha <= 0.0 {
            return None;
        }
        let sides: [f32; 3] = std::array::from_fn(|a| grid.max[a] - grid.min[a]);
        let scale = config.occupancy_cells as f32 / sides.into_iter().fold(f32::MIN, f32::max);
        let cells = sides.map(|side| (side * scale).ceil().max(1.0) as usize);
        // No ray is longer inside the box than its diagonal, so no step is longer than this.
        let step = sides.iter().map(|s| s * s).sum::<f32>().sqrt() / config.samples as f32;
        let mut occupancy = Self {
            min: grid.min,
            scale,
            cells,
            step,
            bound: level(config.occupancy_alpha),
            levels: vec![NEVER; cells.iter().product()],
            reach: 0.0,
            occupied: Vec::new(),
            near: Vec::new(),
        };
        occupancy.refresh();
        Some(occupancy)
    }

    /// Number of cells along x, y, z.
    pub fn cells(&self) -> [usize; 3] {
        self.cells
    }

    /// Level of each cell; with [`Self::reach`], all that the grid learns.
    pub fn levels(&self) -> &[u8] {
        &self.levels
    }

    /// Largest non-rigid offset along an axis of a sample that was not empty, metres.
    pub fn reach(&self) -> f32 {
        self.reach
    }

    /// Sets levels and reach; `None` if there is not one level per cell or the reach is not a
    /// length.
    pub fn with_learned(mut self, levels: &[u8], reach: f32) -> Option<Self> {
        if levels.len() != self.levels.len() || !(reach.is_finite() && reach >= 0.0) {
            return None;
        }
        self.levels.copy_from_slice(levels);
        self.reach = reach;
        self.refresh();
        Some(self)
    }

    /// Takes levels and reach from `other` if both grids have the same box, up to the rounding of a
    /// stored skeleton. Levels of another box do not apply.
    pub fn with_levels_of(self, other: Option<&Self>) -> Self {
        let near = |a: f32, b: f32| (a - b).abs() <= 1e-5 * a.abs().max(1.0);
        match other {
            Some(other)
                if self.cells == other.cells
                    && near(self.scale, other.scale)
                    && self.min.iter().zip(&other.min).all(|(a, b)| near(*a, *b)) =>
            {
                let mut taught = self;
                taught.levels.copy_from_slice(&other.levels);
                taught.reach = other.reach;
                taught.refresh();
                taught
            }
            _ => self,
        }
    }

    /// Share of the cells that are occupied.
    pub fn share(&self) -> f64 {
        let ones: u32 = self.occupied.iter().map(|word| word.count_ones()).sum();
        f64::from(ones) / self.levels.len() as f64
    }

    /// The cell of a point; the nearest one for points outside the box.
    #[inline(always)]
    fn cell(&self, point: [f32; 3]) -> [usize; 3] {
        // Casts of negative numbers and of NaN give 0.
        std::array::from_fn(|a| {
            (((point[a] - self.min[a]) * self.scale) as usize).min(self.cells[a] - 1)
        })
    }

    fn row(&self, [_, y, z]: [usize; 3]) -> usize {
        z * self.cells[1] + y
    }

    /// Whether a sample at a canonical point, metres, is to be evaluated. In a training `step`, some
    /// points in empty cells are, too, in other cells each step.
    #[inline(always)]
    pub fn admits(&self, point: [f32; 3], step: Option<u64>) -> bool {
        self.holds(&self.occupied, point, step)
    }

    /// Whether [`Self::admits`] may hold within [`NEAR`] of a point.
    #[inline(always)]
    pub fn admits_near(&self, point: [f32; 3], step: Option<u64>) -> bool {
        self.holds(&self.near, point, step)
    }

    #[inline(always)]
    fn holds(&self, bits: &[u64], point: [f32; 3], step: Option<u64>) -> bool {
        let cell = self.cell(point);
        let row = self.row(cell);
        let word = bits[row * self.words() + cell[0] / 64];
        if word >> (cell[0] % 64) & 1 == 1 {
            return true;
        }
        step.is_some_and(|step| {
            let index = (row * self.cells[0] + cell[0]) as u64;
            scatter(index ^ step << 32).is_multiple_of(PROBES)
        })
    }

    /// Learns from a training step.
    pub fn learn(&mut self, seen: &DensityObservations) {
        let mut fresh = vec![NEVER; self.levels.len()];
        let mut visited = Vec::new();
        let radius = self.radius();
        let values = seen.densities.iter().zip(&seen.likelihoods);
        let places = seen.moved.as_chunks::<3>().0.iter();
        let places = places.zip(seen.canonical.as_chunks::<3>().0);
        for ((moved, canonical), (density, likelihood)) in places.zip(values) {
            let alpha = opacity(*density, self.step, *likelihood);
            if alpha.is_nan() {
                continue;
            }
            if level(alpha) >= self.bound {
                let offsets = moved.iter().zip(canonical).map(|(m, c)| (m - c).abs());
                self.reach = offsets.filter(|o| o.is_finite()).fold(self.reach, f32::max);
            }
            let cell = self.cell(*moved);
            let index = self.row(cell) * self.cells[0] + cell[0];
            if fresh[index] == NEVER {
                visited.push(index);
            }
            fresh[index] = fresh[index].max(level(alpha));
        }
        let mut changed = self.radius() != radius;
        for index in visited {
            let old = self.levels[index];
            let new = fresh[index].max(old.saturating_sub(FORGET));
            changed |= old == NEVER || (old < self.bound) != (new < self.bound);
            self.levels[index] = new;
        }
        if changed {
            self.refresh();
        }
    }

    /// Distance, in cells, up to which the neighbours of an occupied cell count as occupied: the
    /// reach of offsets, and at least 1, since bodies grow into their neighbours.
    fn radius(&self) -> usize {
        let reach = (self.reach * self.scale).ceil() as usize;
        let longest = self.cells.into_iter().fold(1, usize::max);
        reach.clamp(1, longest)
    }

    /// Words per row of bits.
    fn words(&self) -> usize {
        self.cells[0].div_ceil(64)
    }

    /// Recomputes the bits from the levels.
    fn refresh(&mut self) {
        let words = self.words();
        let [width, height, depth] = self.cells;
        let mut never = vec![0u64; words * height * depth];
        let mut full = vec![0u64; words * height * depth];
        for (row, levels) in self.levels.chunks_exact(width).enumerate() {
            for (word, levels) in levels.chunks(64).enumerate() {
                let (mut none, mut some) = (0, 0);
                for (i, level) in levels.iter().enumerate() {
                    none |= u64::from(*level == NEVER) << i;
                    some |= u64::from(*level >= self.bound) << i;
                }
                never[row * words + word] = none;
                full[row * words + word] = some;
            }
        }
        // Bits beyond the end of a row belong to no cell.
        let last = u64::MAX >> (64 * words - width);
        for _ in 0..self.radius() {
            full = grown(&full, words, height);
            for row in full.chunks_exact_mut(words) {
                row[words - 1] &= last;
            }
        }
        join(&mut full, &never);
        let mut near = full.clone();
        for _ in 0..(NEAR * self.scale).ceil() as usize {
            near = grown(&near, words, height);
            for row in near.chunks_exact_mut(words) {
                row[words - 1] &= last;
            }
        }
        self.near = near;
        self.occupied = full;
    }
}

/// The cells of `full` with their 26 neighbours: along x, then y, then z. Bits beyond the end of a
/// row may be set.
fn grown(full: &[u64], words: usize, height: usize) -> Vec<u64> {
    let mut wide = full.to_vec();
    for (wide, full) in wide.chunks_exact_mut(words).zip(full.chunks_exact(words)) {
        for i in 0..words {
            let before = if i > 0 { full[i - 1] >> 63 } else { 0 };
            let after = full.get(i + 1).map_or(0, |next| next << 63);
            wide[i] |= full[i] << 1 | full[i] >> 1 | before | after;
        }
    }
    let mut tall = wide.clone();
    let slab = words * height;
    for (tall, wide) in tall.chunks_exact_mut(slab).zip(wide.chunks_exact(slab)) {
        join(&mut tall[words..], wide);
        join(tall, &wide[words..]);
    }
    let mut deep = tall.clone();
    join(&mut deep[slab..], &tall);
    join(&mut deep, &tall[slab..]);
    deep
}

fn join(to: &mut [u64], from: &[u64]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to |= from;
    }
}

/// The level of an opacity, never [`NEVER`]; it increases with the opacity.
fn level(alpha: f32) -> u8 {
    let leading = alpha.max(0.0).to_bits() >> SHIFT;
    (leading + 1).saturating_sub(LOWEST).clamp(1, 255) as u8
}

/// Hashes a number (the finaliser of MurmurHash3).
fn scatter(mut bits: u64) -> u32 {
    bits = (bits ^ bits >> 33).wrapping_mul(0xff51_afd7_ed55_8ccd);
    bits = (bits ^ bits >> 33).wrapping_mul(0xc4ce_b9fe_1a85_ec53);
    (bits ^ bits >> 33) as u32
}

#[cfg(test)]
#[path = "occupancy/tests.rs"]
mod tests;
