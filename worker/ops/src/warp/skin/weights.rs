//! Skinning of points that are fixed in the canonical frame: their skinning weights are looked up once, for all
//! poses.

use super::super::WarpGrid;
use super::super::inverse::solve::{Skinning, rigid_inverse};
use crate::form::{Form, Work, multiply_add};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Points per task.
const BLOCK: usize = 512;

/// The bones that move each point, and their skinning weights, which sum to 1.
pub struct SkinningWeights {
    /// `[N + 1]`: the bones of point i are entries `starts[i]..starts[i + 1]`.
    starts: Vec<u32>,
    bones: Vec<(u32, f32)>,
}

impl SkinningWeights {
    /// The skinning weights at canonical `points` `[N, 3]`, from the motion weights `weights` of `bones` bones as for
    /// [`super::super::warp`].
    pub fn new(weights: &[f32], bones: usize, points: &[f32], grid: &WarpGrid) -> Self {
        // Weights do not depend on where bones are.
        let anywhere = vec![0.0; 12 * bones];
        let skinning = Skinning::new(weights, &anywhere, grid);
        let points = points.as_chunks::<3>().0;
        let found: Vec<Vec<(usize, f32)>> = points
            .par_iter()
            .with_min_len(BLOCK)
            .map(|at| skinning.skinning_weights(*at))
            .collect();
        Self::from_lists(found)
    }

    /// The skinning weights of each point as a list of bones and their weights, which sum to 1.
    pub fn from_lists(lists: Vec<Vec<(usize, f32)>>) -> Self {
        let (mut starts, mut bones) = (vec![0], Vec::new());
        for weights in lists {
            bones.extend(
                weights
                    .into_iter()
                    .map(|(bone, weight)| (bone as u32, weight)),
            );
            starts.push(bones.len() as u32);
        }
        Self { starts, bones }
    }

    /// The bones of point `i`, and their shares.
    pub fn of(&self, i: usize) -> &[(u32, f32)] {
        &self.bones[self.starts[i] as usize..self.starts[i + 1] as usize]
    }

    /// The weights of points, each in place of a group of others with their shares in it, which sum to 1.
    #[must_use]
    pub fn merged(&self, groups: &[Vec<(usize, f32)>]) -> Self {
        let merged = |group: &Vec<(usize, f32)>| {
            let mut sums: BTreeMap<u32, f32> = BTreeMap::new();
            for (i, share) in group {
                for (bone, weight) in self.of(*i) {
                    *sums.entry(*bone).or_default() += share * weight;
                }
            }
            let sums = sums.into_iter();
            sums.map(|(bone, weight)| (bone as usize, weight)).collect()
        };
        Self::from_lists(groups.iter().map(merged).collect())
    }

    /// The bone with the largest share in point `i`; 0 without any.
    pub fn largest(&self, i: usize) -> u16 {
        let largest = self.of(i).iter().max_by(|a, b| a.1.total_cmp(&b.1));
        // A skeleton has at most 256 joints.
        largest.map_or(0, |(bone, _)| *bone as u16)
    }

    /// Canonical to posed `[N, 12]` as in [`super::skin`], with rigid `transforms` `[K, 12]`.
    pub fn skin(&self, transforms: &[f32]) -> Vec<f32> {
        let bones = transforms.as_chunks::<12>().0.iter();
        let forward: Vec<[f32; 12]> = bones.map(rigid_inverse).collect();
        let mut blended = vec![0f32; 12 * (self.starts.len() - 1)];
        let rows = blended.as_chunks_mut::<12>().0;
        let blocks = rows.par_chunks_mut(BLOCK).enumerate();
        blocks.for_each(|(block, rows)| {
            Form::best().run(Blends {
                weights: self,
                forward: &forward,
                first: block * BLOCK,
                rows,
            });
        });
        blended
    }
}

/// Blends the transforms of some points.
struct Blends<'a> {
    weights: &'a SkinningWeights,
    forward: &'a [[f32; 12]],
    first: usize,
    rows: &'a mut [[f32; 12]],
}

impl Work for Blends<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        // Σ wᵢ Gᵢ
        let starts = &self.weights.starts[self.first..];
        for (row, ends) in self.rows.iter_mut().zip(starts.windows(2)) {
            for &(bone, weight) in &self.weights.bones[ends[0] as usize..ends[1] as usize] {
                for (to, from) in row.iter_mut().zip(&self.forward[bone as usize]) {
                    *to = multiply_add::<FMA>(weight, *from, *to);
                }
            }
        }
    }
}
