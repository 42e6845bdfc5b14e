//! Inverse skinning on CPU threads. As in the warp, the backward pass runs over points, then over
//! bones, so that the order of sums does not depend on the number of threads.

use super::solve::{Skinning, apply, inverse};
use super::{InverseOps, WarpGrid};
use crate::flex::tensor;
use burn::backend::{Flex, TensorMetadata, tensor::FloatTensor};
use rayon::prelude::*;

/// Points per task.
const BLOCK: usize = 512;

impl InverseOps for Flex {
    fn unpose(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        near: FloatTensor<Self>,
        otherwise: FloatTensor<Self>,
        grid: WarpGrid,
        steps: usize,
    ) -> FloatTensor<Self> {
        let rows = points.shape()[0];
        let [weights, transforms, points, near, otherwise] =
            [weights, transforms, points, near, otherwise].map(|tensor| tensor.to_contiguous());
        let skinning = Skinning::new(weights.storage(), transforms.storage(), &grid);
        let starts = [near.storage(), otherwise.storage()];
        let found = forward(&skinning, points.storage(), starts, steps);
        tensor(found, [rows, 4])
    }

    fn unpose_backward(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        found: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        grid: WarpGrid,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        let [rows, voxels] = weights.shape().dims();
        let (bones, points) = (transforms.shape()[0], found.shape()[0]);
        let [weights, transforms, found, grad] =
            [weights, transforms, found, grad].map(|tensor| tensor.to_contiguous());
        let gradients = backward(
            weights.storage(),
            transforms.storage(),
            found.storage(),
            grad.storage(),
            &grid,
        );
        (
            tensor(gradients.weights, [rows, voxels]),
            tensor(gradients.transforms, [bones, 12]),
            tensor(gradients.otherwise, [points, 3]),
        )
    }
}

/// `[N, 4]` as [`InverseOps::unpose`] returns it.
fn forward(skinning: &Skinning<'_>, points: &[f32], starts: [&[f32]; 2], steps: usize) -> Vec<f32> {
    let [near, otherwise] = starts.map(|start| start.as_chunks::<3>().0);
    let points = points.as_chunks::<3>().0;
    let mut output = vec![0f32; 4 * points.len()];
    let rows = output.as_chunks_mut::<4>().0;
    rows.par_iter_mut()
        .zip(points.par_iter().zip(near).zip(otherwise))
        .with_min_len(BLOCK)
        .for_each(|(row, ((x, near), [a, b, c]))| {
            *row = match skinning.solve(*x, *near, steps) {
                Some([x, y, z]) => [x, y, z, 1.0],
                None => [*a, *b, *c, 0.0],
            };
        });
    output
}

/// Gradients to the inputs, of their shapes.
struct Gradients {
    weights: Vec<f32>,
    transforms: Vec<f32>,
    otherwise: Vec<f32>,
}

/// A bone with a weight at a found point.
struct Visit {
    point: u32,
    /// Share of the bone in forward skinning there.
    share: f32,
    /// Gradient to its weight.
    to_weight: f32,
}

/// A block of points: the visits bone by bone, and the gradient to the posed position that each point
/// stands for.
struct Block {
    first: usize,
    visits: Vec<Vec<Visit>>,
    pulls: Vec<[f32; 3]>,
}

fn backward(
    weights: &[f32],
    transforms: &[f32],
    found: &[f32],
    grad: &[f32],
    grid: &WarpGrid,
) -> Gradients {
    let skinning = Skinning::new(weights, transforms, grid);
    let (found, grad) = (found.as_chunks::<4>().0, grad.as_chunks::<4>().0);
    let bones = transforms.as_chunks::<12>().0;
    let blocks: Vec<Block> = found
        .par_chunks(BLOCK)
        .zip(grad.par_chunks(BLOCK))
        .enumerate()
        .map(|(block, (found, grad))| visits(&skinning, bones.len(), block * BLOCK, found, grad))
        .collect();

    let voxels = grid.voxels();
    let mut to_weights = vec![0f32; weights.len()];
    let mut to_transforms = vec![0f32; transforms.len()];
    to_weights
        .par_chunks_mut(voxels)
        .zip(to_transforms.par_chunks_mut(12))
        .enumerate()
        .for_each(|(bone, (to_volume, to_transform))| {
            for block in &blocks {
                for visit in &block.visits[bone] {
                    let [x, y, z, _] = found[visit.point as usize];
                    let at = [x, y, z];
                    if let Some(cell) = skinning.cell(at) {
                        let volume = skinning.volume(bone);
                        cell.spread(volume, to_volume, visit.to_weight, grid.sides());
                    }
                    let pull = block.pulls[visit.point as usize - block.first];
                    turn_gradient(&bones[bone], at, pull, visit.share, to_transform);
                }
            }
        });
    let otherwise = found.iter().zip(grad).flat_map(|(found, grad)| {
        let open = 1.0 - found[3];
        [grad[0] * open, grad[1] * open, grad[2] * open]
    });
    Gradients {
        weights: to_weights,
        transforms: to_transforms,
        otherwise: otherwise.collect(),
    }
}

/// The visits of a block of points, of which those without a gradient or that were not found have
/// none. Of x = Σ wᵢ Gᵢ c with weights wᵢ = vᵢ / Σ v, the change of c is
/// −J⁻¹ Σ (dwᵢ Gᵢ c + wᵢ dGᵢ c).
fn visits(
    skinning: &Skinning<'_>,
    bones: usize,
    first: usize,
    found: &[[f32; 4]],
    grad: &[[f32; 4]],
) -> Block {
    let mut block = Block {
        first,
        visits: (0..bones).map(|_| Vec::new()).collect(),
        pulls: vec![[0.0; 3]; found.len()],
    };
    for (i, ([x, y, z, is_found], grad)) in found.iter().zip(grad).enumerate() {
        if *is_found == 0.0 || grad[..3] == [0.0; 3] {
            continue;
        }
        let at = [*x, *y, *z];
        let Some((cell, blend)) = skinning.cell(at).zip(skinning.blend::<false>(at)) else {
            continue;
        };
        let (jacobian, posed) = skinning.jacobian(at, &cell, &blend);
        let plain = std::array::from_fn(|r| std::array::from_fn(|c| blend.transform[4 * r + c]));
        // Where weights change so fast that skinning folds space, their change is left out.
        let Some(inverse) = inverse(&jacobian).or_else(|| inverse(&plain)) else {
            continue;
        };
        let pull: [f32; 3] =
            std::array::from_fn(|r| -(0..3).map(|c| inverse[c][r] * grad[c]).sum::<f32>());
        block.pulls[i] = pull;
        skinning.each_weight::<false>(&cell, |bone, weight| {
            let there = apply(&skinning.forward[bone], at);
            let along: f32 = (0..3).map(|a| pull[a] * (there[a] - posed[a])).sum();
            block.visits[bone].push(Visit {
                point: (first + i) as u32,
                share: weight / blend.sum,
                to_weight: along / blend.sum,
            });
        });
    }
    block
}

/// Adds the gradient to a bone's posed-to-canonical transform [R, t], from the gradient `pull` to
/// `share` Rᵀ (c − t).
fn turn_gradient(bone: &[f32; 12], at: [f32; 3], pull: [f32; 3], share: f32, to: &mut [f32]) {
    for a in 0..3 {
        let from_shift = at[a] - bone[4 * a + 3];
        let mut turned = 0.0;
        for b in 0..3 {
            to[4 * a + b] += share * from_shift * pull[b];
            turned += bone[4 * a + b] * pull[b];
        }
        to[4 * a + 3] -= share * turned;
    }
}
