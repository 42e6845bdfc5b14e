//! The search for one point.

use super::super::grid::Cell;
use super::{MAX_LAST_STEP, MIN_DETERMINANT, MIN_SUM, STEPS, WarpGrid};
use crate::form::{Form, Work, multiply_add};
use rayon::prelude::*;

/// Step length below which a search has converged, metres.
const CONVERGED: f32 = 1e-4;
/// Number of single bones that a search starts from, the ones with the largest weights first.
const BONES: usize = 2;
/// Smallest weight of a bone that a search starts from.
const MIN_START: f32 = 0.1;
/// Bones whose weights are added up together.
const LANES: usize = 8;

type Vec3 = [f32; 3];
type Mat3 = [[f32; 3]; 3];

/// A posed body in host memory.
pub struct Skinning<'a> {
    weights: &'a [f32],
    /// `[V, K]`, K a multiple of [`LANES`]: the weights of all bones at a node are contiguous.
    nodes: Vec<f32>,
    /// K.
    width: usize,
    /// Canonical to posed, of each bone, row-major 3x4.
    pub forward: Vec<[f32; 12]>,
    /// Posed to canonical, of each bone: the inverse of [`Self::forward`].
    inverse_transforms: &'a [[f32; 12]],
    grid: &'a WarpGrid,
    scale: Vec3,
}

/// Forward skinning at a canonical point.
#[derive(Clone, Copy)]
pub(in crate::warp) struct Blend {
    /// Σ wᵢ Gᵢ, with weights that sum to 1, row-major 3x4.
    pub transform: [f32; 12],
    /// Sum of the weights before.
    pub sum: f32,
}

impl<'a> Skinning<'a> {
    /// `weights` and rigid `transforms` as for [`super::super::warp`].
    pub fn new(weights: &'a [f32], transforms: &'a [f32], grid: &'a WarpGrid) -> Self {
        let bones = transforms.as_chunks::<12>().0;
        let width = bones.len().next_multiple_of(LANES);
        Self {
            weights,
            nodes: node_by_node(weights, bones.len(), width, grid.voxels()),
            width,
            forward: bones.iter().map(rigid_inverse).collect(),
            inverse_transforms: bones,
            grid,
            scale: grid.scale(),
        }
    }

    /// The canonical point that is skinned to `x`, searched from `blend` and then from where single
    /// bones transform `x`.
    pub fn search(&self, x: Vec3, blend: Vec3) -> Option<Vec3> {
        self.solve(x, blend, STEPS).or_else(|| {
            let starts = self.by_bones(x);
            starts.into_iter().find_map(|at| self.solve(x, at, STEPS))
        })
    }

    /// The canonical point that is skinned to `x`, searched from `start`.
    pub fn solve(&self, x: Vec3, start: Vec3, steps: usize) -> Option<Vec3> {
        Form::best().run(Search {
            skinning: self,
            x,
            start,
            steps,
        })
    }

    /// Where the bones with the largest weights transform `x`.
    fn by_bones(&self, x: Vec3) -> Vec<Vec3> {
        let mut by_bones: Vec<(f32, Vec3)> = Vec::new();
        for (bone, inverse_transforms) in self.inverse_transforms.iter().enumerate() {
            let at = apply(inverse_transforms, x);
            if let Some(cell) = self.cell(at) {
                let weight = cell.sample(self.volume(bone), self.grid.sides());
                if weight > MIN_START {
                    by_bones.push((weight, at));
                }
            }
        }
        by_bones.sort_by(|(one, _), (other, _)| other.total_cmp(one));
        by_bones.into_iter().take(BONES).map(|(_, at)| at).collect()
    }

    /// The volume of a bone's weights.
    pub(in crate::warp) fn volume(&self, bone: usize) -> &'a [f32] {
        let voxels = self.grid.voxels();
        &self.weights[bone * voxels..(bone + 1) * voxels]
    }

    #[inline(always)]
    pub(in crate::warp) fn cell(&self, at: Vec3) -> Option<Cell> {
        Cell::of(at, self.grid.min, self.scale, self.grid.sides())
    }

    /// Calls `visit` with each bone that has a weight at `at`, and the weight.
    #[inline(always)]
    pub(in crate::warp) fn each_weight<const FMA: bool>(
        &self,
        cell: &Cell,
        mut visit: impl FnMut(usize, f32),
    ) {
        let mut taps = [(0usize, 0f32); 8];
        let mut count = 0;
        cell.taps(self.grid.sides(), |index, share, _| {
            taps[count] = (index * self.width, share);
            count += 1;
        });
        for group in (0..self.width).step_by(LANES) {
            let mut sums = [0f32; LANES];
            for &(row, share) in &taps[..count] {
                let weights = &self.nodes[row + group..row + group + LANES];
                for (sum, weight) in sums.iter_mut().zip(weights) {
                    *sum = multiply_add::<FMA>(share, *weight, *sum);
                }
            }
            for (lane, weight) in sums.into_iter().enumerate() {
                if weight > self.grid.floor {
                    visit(group + lane, weight);
                }
            }
        }
    }

    /// Forward skinning at `at`; `None` where no bone has a weight.
    #[inline(always)]
    pub(in crate::warp) fn blend<const FMA: bool>(&self, at: Vec3) -> Option<Blend> {
        let cell = self.cell(at)?;
        let (mut transform, mut sum) = ([0f32; 12], 0.0);
        self.each_weight::<FMA>(&cell, |bone, weight| {
            sum += weight;
            for (to, from) in transform.iter_mut().zip(&self.forward[bone]) {
                *to = multiply_add::<FMA>(weight, *from, *to);
            }
        });
        // Comparisons are false for a NaN.
        (sum > MIN_SUM).then(|| Blend {
            transform: transform.map(|number| number / sum),
            sum,
        })
    }

    /// The bones that move the canonical point `at`, and their skinning weights, which sum to 1. As in
    /// [`super::super::skin`], it is the first bone where none has a weight.
    pub fn skinning_weights(&self, at: Vec3) -> Vec<(usize, f32)> {
        let mut skinning_weights = Vec::new();
        if let Some(cell) = self.cell(at) {
            self.each_weight::<false>(&cell, |bone, weight| skinning_weights.push((bone, weight)));
        }
        let sum: f32 = skinning_weights.iter().map(|(_, weight)| weight).sum();
        if sum > MIN_SUM {
            skinning_weights
                .iter_mut()
                .for_each(|(_, weight)| *weight /= sum);
            skinning_weights
        } else {
            vec![(0, 1.0)]
        }
    }

    /// Derivative of a bone's weight with respect to the point in `cell`, 1/m.
    pub(in crate::warp) fn slope(&self, bone: usize, cell: &Cell) -> Vec3 {
        let slope = cell.slope(self.volume(bone), self.grid.sides());
        std::array::from_fn(|a| slope[a] * self.scale[a])
    }

    /// J, the derivative of forward skinning Σ wᵢ(c) Gᵢ c with respect to c, and its value.
    pub(super) fn jacobian(&self, at: Vec3, cell: &Cell, blend: &Blend) -> (Mat3, Vec3) {
        let posed = apply(&blend.transform, at);
        let mut j: Mat3 =
            std::array::from_fn(|r| std::array::from_fn(|c| blend.transform[4 * r + c]));
        // J = Σ wᵢ Gᵢ + Σ (Gᵢ c − x) ∇vᵢᵀ / Σ v with wᵢ = vᵢ / Σ v
        self.each_weight::<false>(cell, |bone, _| {
            let slope = self.slope(bone, cell);
            let there = apply(&self.forward[bone], at);
            for (r, row) in j.iter_mut().enumerate() {
                for (c, entry) in row.iter_mut().enumerate() {
                    *entry += (there[r] - posed[r]) * slope[c] / blend.sum;
                }
            }
        });
        (j, posed)
    }
}

/// A search from one point.
struct Search<'s, 'a> {
    skinning: &'s Skinning<'a>,
    x: Vec3,
    start: Vec3,
    steps: usize,
}

impl Work for Search<'_, '_> {
    type Output = Option<Vec3>;

    #[inline(always)]
    fn run<const FMA: bool>(self) -> Option<Vec3> {
        // c ← (Σ wᵢ(c) Gᵢ)⁻¹ x
        let (mut at, mut step) = (self.start, f32::INFINITY);
        for _ in 0..self.steps {
            let next = self.skinning.blend::<FMA>(at)?.undo(self.x)?;
            step = (0..3).fold(0f32, |most, a| most.max((next[a] - at[a]).abs()));
            at = next;
            if step < CONVERGED {
                break;
            }
        }
        // Comparisons are false for a NaN.
        (step < MAX_LAST_STEP).then_some(at)
    }
}

/// `weights` `[K, V]`, bone by bone, as `[V, width]`.
fn node_by_node(weights: &[f32], bones: usize, width: usize, voxels: usize) -> Vec<f32> {
    /// Nodes per task.
    const BLOCK: usize = 256;
    let mut nodes = vec![0f32; voxels * width];
    nodes
        .par_chunks_mut(BLOCK * width)
        .enumerate()
        .for_each(|(block, rows)| {
            for bone in 0..bones {
                let from = &weights[bone * voxels + block * BLOCK..];
                for (row, weight) in rows.chunks_exact_mut(width).zip(from) {
                    row[bone] = *weight;
                }
            }
        });
    nodes
}

impl Blend {
    /// The point that this transform moves to `x`; `None` if it folds space.
    #[inline(always)]
    fn undo(&self, x: Vec3) -> Option<Vec3> {
        let m: Mat3 = std::array::from_fn(|r| std::array::from_fn(|c| self.transform[4 * r + c]));
        let inverse = inverse(&m)?;
        let shifted: Vec3 = std::array::from_fn(|r| x[r] - self.transform[4 * r + 3]);
        Some(std::array::from_fn(|r| {
            (0..3).map(|c| inverse[r][c] * shifted[c]).sum()
        }))
    }
}

/// The inverse of `m`; `None` if its determinant is less than [`MIN_DETERMINANT`].
#[inline(always)]
pub(super) fn inverse(m: &Mat3) -> Option<Mat3> {
    let cross = |a: Vec3, b: Vec3| {
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    };
    let columns = [cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1])];
    let determinant: f32 = (0..3).map(|a| m[0][a] * columns[0][a]).sum();
    // Comparisons are false for a NaN.
    let sound = determinant >= MIN_DETERMINANT;
    sound.then(|| std::array::from_fn(|r| std::array::from_fn(|c| columns[c][r] / determinant)))
}

/// A 3x4 transform applied to a point.
#[inline(always)]
pub fn apply(t: &[f32; 12], x: Vec3) -> Vec3 {
    std::array::from_fn(|r| {
        t[4 * r] * x[0] + t[4 * r + 1] * x[1] + t[4 * r + 2] * x[2] + t[4 * r + 3]
    })
}

/// [Rᵀ, −Rᵀ t] of [R, t].
pub fn rigid_inverse(t: &[f32; 12]) -> [f32; 12] {
    std::array::from_fn(|i| match (i / 4, i % 4) {
        (row, 3) => -(0..3).map(|a| t[4 * a + row] * t[4 * a + 3]).sum::<f32>(),
        (row, column) => t[4 * column + row],
    })
}
