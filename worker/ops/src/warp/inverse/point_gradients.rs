//! Gradients to points of the posed body, bone by bone, for fits of poses: the counterpart of
//! [`super::super::point_gradients`] for inverse skinning.

use super::WarpGrid;
use super::solve::{Skinning, apply, inverse};
use rayon::prelude::*;

/// Points per task.
const BLOCK: usize = 512;

/// Gradient to the point where one bone alone would put a canonical point.
#[derive(Clone, Copy, Debug)]
pub struct PointGradient {
    /// Index of the point.
    pub point: u32,
    /// Index of the bone.
    pub bone: u32,
    /// Gₖ c: where the bone alone puts the canonical point, in the body frame, metres.
    pub position: [f32; 3],
    /// Along the axes of the body frame.
    pub gradient: [f32; 3],
}

/// The gradients of `points` `[N, 3]`, in blocks of consecutive points, from the gradient `grad` `[N, 4]` to their
/// `canonical` points `[N, 3]` and likelihoods, of which the last are not read. The gradient to a point that was
/// found is set to 0 in `grad`; the others are results of the blend, and their gradients stay.
pub fn point_gradients(
    weights: &[f32],
    transforms: &[f32],
    points: &[f32],
    canonical: &[f32],
    grad: &mut [f32],
    grid: &WarpGrid,
) -> Vec<Vec<PointGradient>> {
    let skinning = Skinning::new(weights, transforms, grid);
    let points = points.as_chunks::<3>().0.par_chunks(BLOCK);
    let canonical = canonical.as_chunks::<3>().0.par_chunks(BLOCK);
    let grad = grad.as_chunks_mut::<4>().0.par_chunks_mut(BLOCK);
    let blocks = points.zip(canonical).zip(grad).enumerate();
    blocks
        .map(|(block, ((points, canonical), grad))| {
            let mut point_gradients = Vec::new();
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
                // J⁻ᵀ ∂L/∂c, of which each bone has its normalised weight
                let along: [f32; 3] =
                    std::array::from_fn(|r| (0..3).map(|c| inverse[c][r] * to_point[c]).sum());
                skinning.each_weight::<false>(&cell, |bone, weight| {
                    point_gradients.push(PointGradient {
                        point: (block * BLOCK + i) as u32,
                        bone: bone as u32,
                        position: apply(&skinning.forward[bone], *at),
                        gradient: along.map(|f| f * weight / blend.sum),
                    });
                });
                grad[..3].fill(0.0);
            }
            point_gradients
        })
        .collect()
}
