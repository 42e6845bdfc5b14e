//! The warp on CPU threads.
//!
//! The forward pass runs over blocks of points. The backward pass has two parts: over points, to
//! find the bones that have a weight there and the gradient to each weight; then over bones, whose
//! weight volumes are disjoint, so that no thread adds to the memory of another and the order of the sums
//! does not depend on the number of threads. Points whose gradient is 0 are left out.

use super::grid::{Cell, Support, supports};
use super::point_block::{BLOCK, PointBlock};
use super::{MIN_WEIGHT_SUM, WarpGrid, WarpOps};
use crate::flex::tensor;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Flex, TensorMetadata};
use rayon::prelude::*;

impl WarpOps for Flex {
    fn warp(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grid: WarpGrid,
    ) -> FloatTensor<Self> {
        let rows = points.shape()[0];
        let [weights, transforms, points] =
            [weights, transforms, points].map(|tensor| tensor.to_contiguous());
        let output = forward(
            weights.storage(),
            transforms.storage(),
            points.storage(),
            &grid,
        );
        tensor(output, [rows, 4])
    }

    fn warp_backward(
        weights: FloatTensor<Self>,
        transforms: FloatTensor<Self>,
        points: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        grid: WarpGrid,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        let ([rows, voxels], bones) = (weights.shape().dims(), transforms.shape()[0]);
        let [weights, transforms, points, grad] =
            [weights, transforms, points, grad].map(|tensor| tensor.to_contiguous());
        let (to_weights, to_transforms) = backward(
            weights.storage(),
            transforms.storage(),
            points.storage(),
            grad.storage(),
            &grid,
        );
        (
            tensor(to_weights, [rows, voxels]),
            tensor(to_transforms, [bones, 12]),
        )
    }
}

/// Checks that every bone has a weight volume and that points have three coordinates.
///
/// # Panics
/// If not.
fn check(weights: &[f32], transforms: &[f32], points: &[f32], grid: &WarpGrid) {
    let voxels = grid.voxels();
    assert!(
        transforms.len().is_multiple_of(12) && points.len().is_multiple_of(3),
        "{} numbers of transforms and {} of points: 12 per bone and 3 per point",
        transforms.len(),
        points.len()
    );
    assert!(
        weights.len().is_multiple_of(voxels) && weights.len() / voxels >= transforms.len() / 12,
        "{} weights: {voxels} for each of {} bones",
        weights.len(),
        transforms.len() / 12
    );
}

/// `[N, 4]` as in [`super::warp`].
///
/// # Panics
/// If the sizes do not match the grid.
pub fn forward(weights: &[f32], transforms: &[f32], points: &[f32], grid: &WarpGrid) -> Vec<f32> {
    let mut output = forward_unclamped(weights, transforms, points, grid);
    for out in output.as_chunks_mut::<4>().0 {
        out[3] = out[3].clamp(0.0, 1.0);
    }
    output
}

/// [`forward`] with the sum of the weights in the last column as it is: it can exceed 1.
///
/// # Panics
/// If the sizes do not match the grid.
pub fn forward_unclamped(
    weights: &[f32],
    transforms: &[f32],
    points: &[f32],
    grid: &WarpGrid,
) -> Vec<f32> {
    check(weights, transforms, points, grid);
    let sides = grid.sides();
    let voxels = grid.voxels();
    let (min, scale) = (grid.min, grid.scale());
    let supports = supports(weights, transforms.len() / 12, grid);
    let points = points.as_chunks::<3>().0;
    let mut output = vec![0f32; points.len() * 4];
    output
        .as_chunks_mut::<4>()
        .0
        .par_chunks_mut(BLOCK)
        .zip(points.par_chunks(BLOCK))
        .for_each_init(PointBlock::new, |block, (output, points)| {
            block.fill(points.iter());
            for ((bone, volume), support) in transforms
                .chunks_exact(12)
                .zip(weights.chunks_exact(voxels))
                .zip(&supports)
            {
                block.for_each_in_support(bone, support, |i, p| {
                    if let Some(cell) = Cell::of(p, min, scale, sides) {
                        // wₖ = Wₖ(pₖ); Σ wₖ pₖ and Σ wₖ
                        let w = cell.sample(volume, sides);
                        let out = &mut output[i];
                        for a in 0..3 {
                            out[a] += w * p[a];
                        }
                        out[3] += w;
                    }
                });
            }
            for out in output {
                // c = Σ wₖ pₖ / max(Σ wₖ, ε)
                let divisor = out[3].max(MIN_WEIGHT_SUM);
                for value in &mut out[..3] {
                    *value /= divisor;
                }
            }
        });
    output
}

/// A bone that has a weight at a point.
pub(super) struct Influence {
    pub point: u32,
    /// The point that the bone transforms it to, pₖ, canonical metres.
    pub at: [f32; 3],
    /// Normalised weight of the bone in the canonical point, wₖ / Σ w.
    pub weight: f32,
    /// Gradient to the bone's weight wₖ.
    pub to_weight: f32,
}

/// The influences of a block of points, bone by bone.
pub(super) struct Influences {
    pub all: Vec<Influence>,
    /// `[bones + 1]`: the influences of bone k are numbers `starts[k]..starts[k + 1]`.
    pub starts: Vec<usize>,
}

/// Gradients to weights (same shape) and transforms `[K, 12]`, from `grad` `[N, 4]`.
///
/// # Panics
/// If the sizes do not match the grid or each other.
pub fn backward(
    weights: &[f32],
    transforms: &[f32],
    points: &[f32],
    grad: &[f32],
    grid: &WarpGrid,
) -> (Vec<f32>, Vec<f32>) {
    let blocks = all_influences(weights, transforms, points, grad, grid);
    let sides = grid.sides();
    let voxels = grid.voxels();
    let bones = transforms.len() / 12;
    let (min, scale) = (grid.min, grid.scale());
    let (points, grad) = (points.as_chunks::<3>().0, grad.as_chunks::<4>().0);

    let mut to_weights = vec![0f32; weights.len()];
    let mut to_transforms = vec![0f32; bones * 12];
    to_weights
        .par_chunks_mut(voxels)
        .zip(to_transforms.par_chunks_mut(12))
        .enumerate()
        .for_each(|(bone, (to_volume, to_transform))| {
            let volume = &weights[bone * voxels..(bone + 1) * voxels];
            for block in &blocks {
                for influence in &block.all[block.starts[bone]..block.starts[bone + 1]] {
                    let cell = Cell::of(influence.at, min, scale, sides)
                        .expect("an influence was made in a cell of the grid");
                    let (x, g) = (
                        &points[influence.point as usize],
                        &grad[influence.point as usize],
                    );
                    let slope = cell.spread(volume, to_volume, influence.to_weight, sides);
                    // ∂L/∂pₖ = wₖ / s ∂L/∂c + ∂L/∂wₖ ∇Wₖ(pₖ); pₖ = Rₖ x + tₖ: ∂L/∂Rₖ = ∂L/∂pₖ xᵀ, ∂L/∂tₖ = ∂L/∂pₖ
                    for a in 0..3 {
                        let to_p =
                            influence.weight * g[a] + influence.to_weight * slope[a] * scale[a];
                        for (c, to) in to_transform[4 * a..4 * a + 3].iter_mut().enumerate() {
                            *to += to_p * x[c];
                        }
                        to_transform[4 * a + 3] += to_p;
                    }
                }
            }
        });
    (to_weights, to_transforms)
}

/// The influences of all points with a gradient, block by block.
///
/// # Panics
/// If the sizes do not match the grid or each other.
pub(super) fn all_influences(
    weights: &[f32],
    transforms: &[f32],
    points: &[f32],
    grad: &[f32],
    grid: &WarpGrid,
) -> Vec<Influences> {
    check(weights, transforms, points, grid);
    assert_eq!(grad.len() / 4, points.len() / 3, "rows of the gradient");
    let supports = supports(weights, transforms.len() / 12, grid);
    let (points, grad) = (points.as_chunks::<3>().0, grad.as_chunks::<4>().0);
    let active: Vec<u32> = (0..points.len() as u32)
        .filter(|&i| grad[i as usize] != [0.0; 4])
        .collect();
    active
        .par_chunks(BLOCK)
        .map_init(PointBlock::new, |block, active| {
            influences(
                block, weights, transforms, points, grad, grid, &supports, active,
            )
        })
        .collect()
}

/// The influences at the points with the indices `active`, at most a block of them.
#[allow(clippy::too_many_arguments)]
fn influences(
    block: &mut PointBlock,
    weights: &[f32],
    transforms: &[f32],
    points: &[[f32; 3]],
    grad: &[[f32; 4]],
    grid: &WarpGrid,
    supports: &[Support],
    active: &[u32],
) -> Influences {
    let sides = grid.sides();
    let voxels = grid.voxels();
    let (min, scale) = (grid.min, grid.scale());
    let mut found = Influences {
        all: Vec::with_capacity(4 * active.len()),
        starts: vec![0],
    };
    // Σ wₖ pₖ and Σ wₖ of each point.
    let mut sums = vec![[0f32; 4]; active.len()];
    block.fill(active.iter().map(|i| &points[*i as usize]));
    for ((bone, volume), support) in transforms
        .chunks_exact(12)
        .zip(weights.chunks_exact(voxels))
        .zip(supports)
    {
        block.for_each_in_support(bone, support, |i, at| {
            if let Some(cell) = Cell::of(at, min, scale, sides) {
                let w = cell.sample(volume, sides);
                for a in 0..3 {
                    sums[i][a] += w * at[a];
                }
                sums[i][3] += w;
                found.all.push(Influence {
                    // The index in the block, until the sums are known.
                    point: i as u32,
                    at,
                    weight: w,
                    to_weight: 0.0,
                });
            }
        });
        found.starts.push(found.all.len());
    }
    let dot = |g: &[f32; 4], p: &[f32]| g[0] * p[0] + g[1] * p[1] + g[2] * p[2];
    for influence in &mut found.all {
        let i = influence.point as usize;
        let (g, sum) = (&grad[active[i] as usize], sums[i][3]);
        let divisor = sum.max(MIN_WEIGHT_SUM);
        // c = Σ wₖ pₖ / s with s = max(Σ wₖ, ε): ∂L/∂wₖ = ∂L/∂c · pₖ / s + ∂L/∂s, where
        // ∂L/∂s = −∂L/∂c · c / s, or 0 where ε bounds s; and ∂L/∂m of the likelihood m = clamp(Σ wₖ, 0, 1)
        let mean = dot(g, &sums[i][..3]) / divisor;
        let mut to_sum = if sum > MIN_WEIGHT_SUM {
            -mean / divisor
        } else {
            0.0
        };
        if (0.0..=1.0).contains(&sum) {
            to_sum += g[3];
        }
        influence.point = active[i];
        influence.weight /= divisor;
        influence.to_weight = dot(g, &influence.at) / divisor + to_sum;
    }
    found
}
