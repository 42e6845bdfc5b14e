//! Skinning of points that stay where they are: the weights at them are looked up once, for all poses.

use super::super::WarpGrid;
use super::super::inverse::solve::{Skinning, inverse_of_rigid};
use crate::form::{Form, Work, multiply_add};
use rayon::prelude::*;

/// Points per task.
const BLOCK: usize = 512;

/// The bones that carry each point, and their shares, which sum to 1.
pub struct Shares {
    /// `[N + 1]`: the bones of point i are entries `starts[i]..starts[i + 1]`.
    starts: Vec<u32>,
    bones: Vec<(u32, f32)>,
}

impl Shares {
    /// Those of canonical `points` `[N, 3]`, by the `weights` as for [`super::super::warp`] of `bones` bones.
    pub fn new(weights: &[f32], bones: usize, points: &[f32], grid: &WarpGrid) -> Self {
        // Weights do not depend on where bones are.
        let anywhere = vec![0.0; 12 * bones];
        let skinning = Skinning::new(weights, &anywhere, grid);
        let points = points.as_chunks::<3>().0;
        let found: Vec<Vec<(usize, f32)>> = points
            .par_iter()
            .with_min_len(BLOCK)
            .map(|at| skinning.shares(*at))
            .collect();
        let (mut starts, mut bones) = (vec![0], Vec::new());
        for shares in found {
            bones.extend(shares.into_iter().map(|(bone, share)| (bone as u32, share)));
            starts.push(bones.len() as u32);
        }
        Self { starts, bones }
    }

    /// Canonical to posed `[N, 12]`, as [`super::skin`] has it of rigid `transforms` `[K, 12]`.
    pub fn skin(&self, transforms: &[f32]) -> Vec<f32> {
        let bones = transforms.as_chunks::<12>().0.iter();
        let forward: Vec<[f32; 12]> = bones.map(inverse_of_rigid).collect();
        let mut blended = vec![0f32; 12 * (self.starts.len() - 1)];
        let rows = blended.as_chunks_mut::<12>().0;
        let blocks = rows.par_chunks_mut(BLOCK).enumerate();
        blocks.for_each(|(block, rows)| {
            Form::best().run(Blends {
                shares: self,
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
    shares: &'a Shares,
    forward: &'a [[f32; 12]],
    first: usize,
    rows: &'a mut [[f32; 12]],
}

impl Work for Blends<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let starts = &self.shares.starts[self.first..];
        for (row, ends) in self.rows.iter_mut().zip(starts.windows(2)) {
            for &(bone, share) in &self.shares.bones[ends[0] as usize..ends[1] as usize] {
                for (to, from) in row.iter_mut().zip(&self.forward[bone as usize]) {
                    *to = multiply_add::<FMA>(share, *from, *to);
                }
            }
        }
    }
}
