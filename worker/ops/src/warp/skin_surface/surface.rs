//! The points of a surface in host memory, with their bones, base weights and factors.

use super::super::grid::Cell;
use super::{MAX_BONES, MIN_SUM, WarpGrid};

/// Points of a surface with their bones and base weights, and the factors that change these weights.
pub struct Surface<'a> {
    factors: &'a [f32],
    /// Bones with factors: the first ones.
    factored: usize,
    bones: &'a [f32],
    weights: &'a [f32],
    /// B.
    width: usize,
    grid: &'a WarpGrid,
    scale: [f32; 3],
}

/// A bone that moves a point.
#[derive(Clone, Copy, Default)]
pub(super) struct Share {
    pub bone: usize,
    /// Base weight, above 0.
    pub base: f32,
    /// Normalised weight.
    pub weight: f32,
}

/// The skinning weights of a point.
pub(super) struct PointWeights {
    /// The first `count` are those of the point.
    shares: [Share; MAX_BONES],
    count: usize,
    /// The cell of the point and Σ bⱼ fⱼ there; `None` where weights are the base weights.
    pub learned: Option<(Cell, f32)>,
}

impl PointWeights {
    /// The bones that move the point.
    #[inline(always)]
    pub(super) fn shares(&self) -> &[Share] {
        &self.shares[..self.count]
    }
}

impl<'a> Surface<'a> {
    /// `factors` `[C, V]` of the first `factored` bones, `bones` `[N, width]` and base `weights` `[N, width]` as for
    /// [`super::skin_surface`].
    ///
    /// # Panics
    /// If sizes do not match, `width` is 0 or more than [`MAX_BONES`], or an index of a bone is not an integer.
    pub fn new(
        factors: &'a [f32],
        factored: usize,
        bones: &'a [f32],
        weights: &'a [f32],
        width: usize,
        grid: &'a WarpGrid,
    ) -> Self {
        let voxels = grid.voxels();
        assert!(
            (1..=MAX_BONES).contains(&width),
            "{width} bones per point: 1 to {MAX_BONES}"
        );
        assert!(
            bones.len() == weights.len() && bones.len().is_multiple_of(width),
            "{} bones and {} weights: {width} of each per point",
            bones.len(),
            weights.len()
        );
        assert!(
            factors.len().is_multiple_of(voxels),
            "{} factors: {voxels} per bone",
            factors.len()
        );
        assert!(
            factors.len() >= factored * voxels,
            "{} factors: {voxels} for each of {factored} bones",
            factors.len()
        );
        let surface = Self {
            factors,
            factored,
            bones,
            weights,
            width,
            grid,
            scale: grid.scale(),
        };
        surface.check_bones(usize::from(u16::MAX));
        surface
    }

    /// # Panics
    /// If the index of a bone is not an integer below `count`.
    pub(super) fn check_bones(&self, count: usize) {
        let known = |bone: &&f32| (0.0..count as f32).contains(*bone) && bone.fract() == 0.0;
        let unknown = self.bones.iter().find(|bone| !known(bone));
        assert!(unknown.is_none(), "bone {unknown:?} of {count}");
    }

    /// N.
    pub(super) fn points(&self) -> usize {
        self.bones.len() / self.width
    }

    /// The factors of all bones `[C, V]`.
    pub(super) fn factors(&self) -> &'a [f32] {
        self.factors
    }

    pub(super) fn grid(&self) -> &'a WarpGrid {
        self.grid
    }

    /// The cell of the canonical point `at`; `None` outside the box.
    #[inline(always)]
    pub(super) fn cell(&self, at: [f32; 3]) -> Option<Cell> {
        Cell::inside(at, self.grid.min, self.scale, self.grid.sides())
    }

    /// The factors of a bone; `None` if it has the factor 1 everywhere.
    #[inline(always)]
    fn volume(&self, bone: usize) -> Option<&'a [f32]> {
        let voxels = self.grid.voxels();
        (bone < self.factored).then(|| &self.factors[bone * voxels..(bone + 1) * voxels])
    }

    /// Derivative of a bone's factor with respect to the point in `cell`, 1/m; `None` if it has the factor 1 everywhere.
    pub(super) fn slope(&self, bone: usize, cell: &Cell) -> Option<[f32; 3]> {
        let slope = cell.slope(self.volume(bone)?, self.grid.sides());
        Some(std::array::from_fn(|a| slope[a] * self.scale[a]))
    }

    /// The skinning weights of the point with the index `i`, which is at `at`. Bones with a base weight of 0 are left
    /// out.
    #[inline(always)]
    pub(super) fn weights_at(&self, i: usize, at: [f32; 3]) -> PointWeights {
        let mut found = PointWeights {
            shares: [Share::default(); MAX_BONES],
            count: 0,
            learned: None,
        };
        let own = i * self.width..(i + 1) * self.width;
        for (bone, base) in self.bones[own.clone()].iter().zip(&self.weights[own]) {
            if *base != 0.0 {
                found.shares[found.count] = Share {
                    bone: *bone as usize,
                    base: *base,
                    weight: *base,
                };
                found.count += 1;
            }
        }
        let Some(cell) = self.cell(at) else {
            return found;
        };
        let shares = &mut found.shares[..found.count];
        let (mut weighted, mut sum) = ([0f32; MAX_BONES], 0f32);
        for (weighted, share) in weighted.iter_mut().zip(shares.iter()) {
            let factor = match self.volume(share.bone) {
                Some(volume) => cell.sample(volume, self.grid.sides()),
                None => 1.0,
            };
            *weighted = share.base * factor;
            sum += *weighted;
        }
        // Comparisons are false for a NaN.
        if sum >= MIN_SUM {
            for (weighted, share) in weighted.iter().zip(shares) {
                share.weight = weighted / sum;
            }
            found.learned = Some((cell, sum));
        }
        found
    }
}
