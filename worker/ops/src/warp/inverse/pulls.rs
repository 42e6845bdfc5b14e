//! Gradients to points of the posed body as single bones hold them, for fits of poses: the
//! counterpart of [`super::super::pulls`].

use super::WarpGrid;
use super::solve::{Skinning, apply, inverse};
use rayon::prelude::*;

/// Points per task.
const BLOCK: usize = 512;

/// Gradient to one point as one bone holds it.
#[derive(Clone, Copy, Debug)]
pub struct Pull {
    /// Number of the point.
    pub point: u32,
    /// Number of the bone.
    pub bone: u32,
    /// Where the bone alone puts the canonical point, in the body frame, metres.
    pub at: [f32; 3],
    /// Along the axes of the body frame.
    pub force: [f32; 3],
}

/// The pulls, in blocks of points that follow each other, from `grad` `[N, 4]` to the `canonical`
/// points `[N, 3]` (and likelihoods, which are not read) of `points` `[N, 3]`. The gradient to a point
/// that was found is taken out of `grad`; of others, the blend is the result.
pub fn pulls(
    weights: &[f32],
    transforms: &[f32],
    points: &[f32],
    canonical: &[f32],
    grad: &mut [f32],
    grid: &WarpGrid,
) -> Vec<Vec<Pull>> {
    let skinning = Skinning::new(weights, transforms, grid);
    let points = points.as_chunks::<3>().0.par_chunks(BLOCK);
    let canonical = canonical.as_chunks::<3>().0.par_chunks(BLOCK);
    let grad = grad.as_chunks_mut::<4>().0.par_chunks_mut(BLOCK);
    let blocks = points.zip(canonical).zip(grad).enumerate();
    blocks
        .map(|(block, ((points, canonical), grad))| {
            let mut pulls = Vec::new();
            for (i, ((x, at), grad)) in points.iter().zip(canonical).zip(grad).enumerate() {
                let to_point = [grad[0], grad[1], grad[2]];
                if to_point == [0.0; 3] || skinning.solve(*x, *at, 1).is_none() {
                    continue;
                }
                let Some((cell, blend)) = skinning.cell(*at).zip(skinning.blend::<false>(*at))
                else {
                    continue;
                };
                let (jacobian, _) = skinning.jacobian(*at, &cell, &blend);
                let Some(inverse) = inverse(&jacobian) else {
                    continue;
                };
                let along: [f32; 3] =
                    std::array::from_fn(|r| (0..3).map(|c| inverse[c][r] * to_point[c]).sum());
                skinning.each_weight::<false>(&cell, |bone, weight| {
                    pulls.push(Pull {
                        point: (block * BLOCK + i) as u32,
                        bone: bone as u32,
                        at: apply(&skinning.forward[bone], *at),
                        force: along.map(|f| f * weight / blend.sum),
                    });
                });
                grad[..3].fill(0.0);
            }
            pulls
        })
        .collect()
}
