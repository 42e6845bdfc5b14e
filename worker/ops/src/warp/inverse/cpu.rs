//! Inverse skinning on CPU threads. As in the warp, the backward pass runs over points, then over
//! bones, so that the order of the sums does not depend on the number of threads.

use super::solve::{Skinning, apply, inverse};
use super::{InverseOps, WarpGrid};
use crate::flex::tensor;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Flex, TensorMetadata};
use rayon::prelude::*;

/// Points per task.
const BLOCK: usize = 512;

impl InverseOps for Flex {
    fn unpose(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        near: FloatTensor<Self>,
        fallback: FloatTensor<Self>,
        grid: WarpGrid,
        steps: usize,
    ) -> FloatTensor<Self> {
        let rows = points.shape()[0];
        let [weights, transforms, points, near, fallback] =
            [weights, transforms, points, near, fallback].map(|tensor| tensor.to_contiguous());
        let skinning = Skinning::new(weights.storage(), transforms.storage(), &grid);
        let starts = [near.storage(), fallback.storage()];
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
            tensor(gradients.fallback, [points, 3]),
        )
    }
}

/// `[N, 4]` as [`InverseOps::unpose`] returns it.
fn forward(skinning: &Skinning<'_>, points: &[f32], starts: [&[f32]; 2], steps: usize) -> Vec<f32> {
    let [near, fallback] = starts.map(|start| start.as_chunks::<3>().0);
    let points = points.as_chunks::<3>().0;
    let mut output = vec![0f32; 4 * points.len()];
    let rows = output.as_chunks_mut::<4>().0;
    rows.par_iter_mut()
        .zip(points.par_iter().zip(near).zip(fallback))
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
    fallback: Vec<f32>,
}

/// A bone with a weight at a found point.
struct Influence {
    point: u32,
    /// Normalised weight wᵢ of the bone in forward skinning there.
    weight: f32,
    /// Gradient to its weight.
    to_weight: f32,
}

/// A block of points: the influences bone by bone, and for each point the gradient to its posed position.
struct Block {
    first: usize,
    influences: Vec<Vec<Influence>>,
    to_posed: Vec<[f32; 3]>,
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
        .map(|(block, (found, grad))| {
            influences(&skinning, bones.len(), block * BLOCK, found, grad)
        })
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
                for influence in &block.influences[bone] {
                    let [x, y, z, _] = found[influence.point as usize];
                    let at = [x, y, z];
                    if let Some(cell) = skinning.cell(at) {
                        let volume = skinning.volume(bone);
                        cell.spread(volume, to_volume, influence.to_weight, grid.sides());
                    }
                    let to_posed = block.to_posed[influence.point as usize - block.first];
                    rigid_backward(&bones[bone], at, to_posed, influence.weight, to_transform);
                }
            }
        });
    let fallback = found.iter().zip(grad).flat_map(|(found, grad)| {
        let open = 1.0 - found[3];
        [grad[0] * open, grad[1] * open, grad[2] * open]
    });
    Gradients {
        weights: to_weights,
        transforms: to_transforms,
        fallback: fallback.collect(),
    }
}

/// The influences at a block of points; points without a gradient or that were not found have none.
///
/// By the implicit function theorem, x = Σ wᵢ(c) Gᵢ c with fixed x and wᵢ = vᵢ / Σ v has
/// dc = −J⁻¹ Σ (dwᵢ Gᵢ c + wᵢ dGᵢ c), where J is the derivative of the right side with respect to c.
fn influences(
    skinning: &Skinning<'_>,
    bones: usize,
    first: usize,
    found: &[[f32; 4]],
    grad: &[[f32; 4]],
) -> Block {
    let mut block = Block {
        first,
        influences: (0..bones).map(|_| Vec::new()).collect(),
        to_posed: vec![[0.0; 3]; found.len()],
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
        // Where weights change so fast that skinning folds space, their derivative is left out of J.
        let Some(inverse) = inverse(&jacobian).or_else(|| inverse(&plain)) else {
            continue;
        };
        // −J⁻ᵀ ∂L/∂c: the gradient to Σ wᵢ Gᵢ c
        let to_posed: [f32; 3] =
            std::array::from_fn(|r| -(0..3).map(|c| inverse[c][r] * grad[c]).sum::<f32>());
        block.to_posed[i] = to_posed;
        skinning.each_weight::<false>(&cell, |bone, weight| {
            let there = apply(&skinning.forward[bone], at);
            // wᵢ = vᵢ / Σ v: ∂L/∂vᵢ = −J⁻ᵀ ∂L/∂c · (Gᵢ c − x) / Σ v
            let along: f32 = (0..3).map(|a| to_posed[a] * (there[a] - posed[a])).sum();
            block.influences[bone].push(Influence {
                point: (first + i) as u32,
                weight: weight / blend.sum,
                to_weight: along / blend.sum,
            });
        });
    }
    block
}

/// Adds the gradient to a bone's posed-to-canonical transform [R, t], from the gradient `to_posed` to
/// `weight` Rᵀ (c − t).
fn rigid_backward(bone: &[f32; 12], at: [f32; 3], to_posed: [f32; 3], weight: f32, to: &mut [f32]) {
    for a in 0..3 {
        let from_shift = at[a] - bone[4 * a + 3];
        let mut turned = 0.0;
        for b in 0..3 {
            to[4 * a + b] += weight * from_shift * to_posed[b];
            turned += bone[4 * a + b] * to_posed[b];
        }
        to[4 * a + 3] -= weight * turned;
    }
}
