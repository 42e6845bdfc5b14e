//! Where in a person's canonical box there is anything: an opacity a cell, learned from what
//! training sees anyway, so that samples in empty cells need not be evaluated.
//!
//! It is the opacity of a step through the cell, foreground likelihood included: where bones
//! hardly weigh, no loss ever lowers the density. It is kept as one byte of its logarithm. Each step that visits a cell lowers
//! it by a few levels and raises it to the largest opacity seen there, so that what
//! vanishes is forgotten after some visits and never without evidence. It does not depend on
//! the order of a step's samples, nor on the number of threads.
//!
//! What is learned belongs to the place where the canonical field was asked, after the non-rigid
//! offset, which depends on the pose. Samples are looked up before it, when the offset is not
//! known yet: a cell is left out only when everything within the largest offset seen is empty.

use crate::config::MarchConfig;
use crate::ops::composite::opacity;
use crate::ops::warp::WarpGrid;

/// Levels are the leading bits of a float: eight for each power of two.
const SHIFT: u32 = 20;
/// Level 1 holds every opacity under 2⁻²⁰.
const LOWEST: u32 = (127 - 20) << 3;
/// Levels that a cell loses with each step that visits it: 30 % of its opacity.
const FORGET: u8 = 4;
/// No sample was ever seen in the cell.
const NEVER: u8 = 0;
/// One in so many pairs of an empty cell and a step is sampled all the same, so that training
/// hears when something grows there.
const PROBES: u32 = 32;

/// Densities that a step has seen, for the grid to learn from.
pub struct DensityObservations {
    /// `[n, 3]`, canonical metres, where bones carry the samples: what is looked up.
    pub canonical: Vec<f32>,
    /// `[n, 3]`, canonical metres, after the non-rigid offset: where the field was asked.
    pub moved: Vec<f32>,
    /// `[n]`, 1/m.
    pub densities: Vec<f32>,
    /// `[n]`, of the foreground.
    pub likelihoods: Vec<f32>,
}

/// One person's grid. Cells are cubes; x runs fastest, then y, z.
#[derive(Clone, Debug, PartialEq)]
pub struct Occupancy {
    min: [f32; 3],
    /// Cells a metre.
    scale: f32,
    cells: [usize; 3],
    /// Length that opacities are taken of, metres.
    step: f32,
    /// The first level that counts as something.
    bound: u8,
    levels: Vec<u8>,
    /// Largest offset along an axis that carried a sample to something, metres.
    reach: f32,
    /// One bit per cell, each row from a word of its own: whether something is within
    /// [`Self::radius`] cells of it, or it was never seen.
    occupied: Vec<u64>,
}

impl Occupancy {
    /// A grid over the box of `grid` that knows nothing yet; `None` where the configuration
    /// wants none.
    pub fn new(grid: &WarpGrid, config: &MarchConfig) -> Option<Self> {
        if config.occupancy_cells == 0 || config.occupancy_alpha <= 0.0 {
            return None;
        }
        let sides: [f32; 3] = std::array::from_fn(|a| grid.max[a] - grid.min[a]);
        let scale = config.occupancy_cells as f32 / sides.into_iter().fold(f32::MIN, f32::max);
        let cells = sides.map(|side| (side * scale).ceil().max(1.0) as usize);
        // No ray has a longer way through the box, and so none has longer steps.
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
        };
        occupancy.refresh();
        Some(occupancy)
    }

    /// Cells along x, y, z.
    pub fn cells(&self) -> [usize; 3] {
        self.cells
    }

    /// One byte per cell, which with [`Self::reach`] is all that is learned.
    pub fn levels(&self) -> &[u8] {
        &self.levels
    }

    /// Largest offset along an axis that carried a sample to something, metres.
    pub fn reach(&self) -> f32 {
        self.reach
    }

    /// The grid with the bytes and the reach of another of the same shape; `None` when there are
    /// not as many bytes, or the reach is no length.
    pub fn with_learned(mut self, levels: &[u8], reach: f32) -> Option<Self> {
        if levels.len() != self.levels.len() || !(reach.is_finite() && reach >= 0.0) {
            return None;
        }
        self.levels.copy_from_slice(levels);
        self.reach = reach;
        self.refresh();
        Some(self)
    }

    /// The grid with what `other` knows, if that is of the same box but for the rounding of a
    /// written skeleton. What was learned in one box says nothing about another's.
    pub fn taught_by(self, other: Option<&Self>) -> Self {
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

    /// Share of the cells that count as occupied.
    pub fn share(&self) -> f64 {
        let ones: u32 = self.occupied.iter().map(|word| word.count_ones()).sum();
        f64::from(ones) / self.levels.len() as f64
    }

    /// The cell of a point; points outside the box count to its border.
    #[inline(always)]
    fn cell(&self, point: [f32; 3]) -> [usize; 3] {
        // A cast of what is negative or not a number gives 0.
        std::array::from_fn(|a| {
            (((point[a] - self.min[a]) * self.scale) as usize).min(self.cells[a] - 1)
        })
    }

    fn row(&self, [_, y, z]: [usize; 3]) -> usize {
        z * self.cells[1] + y
    }

    /// Whether there may be anything around a canonical point, metres. With a `step` of a
    /// training, some points are let through in turn even where there is nothing.
    #[inline(always)]
    pub fn admits(&self, point: [f32; 3], step: Option<u64>) -> bool {
        let cell = self.cell(point);
        let row = self.row(cell);
        let word = self.occupied[row * self.words() + cell[0] / 64];
        if word >> (cell[0] % 64) & 1 == 1 {
            return true;
        }
        step.is_some_and(|step| {
            let index = (row * self.cells[0] + cell[0]) as u64;
            scatter(index ^ step << 32).is_multiple_of(PROBES)
        })
    }

    /// Learns from a step.
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

    /// Cells on every side of one that holds something that count as occupied, too: as far as
    /// offsets reach, and at least the neighbours, into which things grow.
    fn radius(&self) -> usize {
        let reach = (self.reach * self.scale).ceil() as usize;
        let longest = self.cells.into_iter().fold(1, usize::max);
        reach.clamp(1, longest)
    }

    /// Words per row of bits.
    fn words(&self) -> usize {
        self.cells[0].div_ceil(64)
    }

    /// Makes the bits of the levels.
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
        // What runs over the end of a row is no cell's.
        let last = u64::MAX >> (64 * words - width);
        for _ in 0..self.radius() {
            full = grown(&full, words, height);
            for row in full.chunks_exact_mut(words) {
                row[words - 1] &= last;
            }
        }
        join(&mut full, &never);
        self.occupied = full;
    }
}

/// The cells of `full` and their 26 neighbours each: along x, then y, then z. Bits may run over
/// the end of a row.
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

/// The level that an opacity falls into, never [`NEVER`]. It does not fall where opacities rise.
fn level(alpha: f32) -> u8 {
    let leading = alpha.max(0.0).to_bits() >> SHIFT;
    (leading + 1).saturating_sub(LOWEST).clamp(1, 255) as u8
}

/// Mixes a number's bits (the finaliser of MurmurHash3).
fn scatter(mut bits: u64) -> u32 {
    bits = (bits ^ bits >> 33).wrapping_mul(0xff51_afd7_ed55_8ccd);
    bits = (bits ^ bits >> 33).wrapping_mul(0xc4ce_b9fe_1a85_ec53);
    (bits ^ bits >> 33) as u32
}

#[cfg(test)]
#[path = "occupancy/tests.rs"]
mod tests;
