//! The warp on CPU threads.
//!
//! The forward pass runs over blocks of points. The backward pass has two parts: over points, to
//! find the bones that have a weight there and the gradient to each weight; then over bones, whose
//! volumes are disjoint, so that no thread adds to another's memory and the order of the sums does
//! not depend on the number of threads. Points without a gradient take no part.

use super::grid::{Cell, Support, supports};
use super::visits::{BLOCK, Block};
use super::{MIN_WEIGHT_SUM, WarpGrid, WarpOps};
use crate::flex::tensor;
use burn::backend::{Flex, TensorMetadata, tensor::FloatTensor};
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

/// Checks that there is a volume for every bone, and whole points.
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
    let mut output = unlimited(weights, transforms, points, grid);
    for out in output.as_chunks_mut::<4>().0 {
        out[3] = out[3].clamp(0.0, 1.0);
    }
    output
}

/// The same with the plain sum of the weights, which can exceed 1, in the last column.
///
/// # Panics
/// If the sizes do not match the grid.
pub fn unlimited(weights: &[f32], transforms: &[f32], points: &[f32], grid: &WarpGrid) -> Vec<f32> {
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
        .for_each_init(Block::new, |block, (output, points)| {
            block.fill(points.iter());
            for ((bone, volume), support) in transforms
                .chunks_exact(12)
                .zip(weights.chunks_exact(voxels))
                .zip(&supports)
            {
                block.visit(bone, support, |i, p| {
                    if let Some(cell) = Cell::of(p, min, scale, sides) {
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
                let divisor = out[3].max(MIN_WEIGHT_SUM);
                for value in &mut out[..3] {
                    *value /= divisor;
                }
            }
        });
    output
}

/// A point where a bone has a weight.
pub(super) struct Visit {
    pub point: u32,
    /// The point as the bone carries it, canonical metres.
    pub at: [f32; 3],
    /// Share of the bone in the canonical point.
    pub share: f32,
    /// Gradient to the bone's weight.
    pub to_weight: f32,
}

/// The visits of a block of points, bone by bone.
pub(super) struct Visits {
    pub all: Vec<Visit>,
    /// `[bones + 1]`: the visits of bone k are numbers `starts[k]..starts[k + 1]`.
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
    let blocks = all_visits(weights, transforms, points, grad, grid);
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
                for visit in &block.all[block.starts[bone]..block.starts[bone + 1]] {
                    let cell = Cell::of(visit.at, min, scale, sides)
                        .expect("a visit was made in a cell of the grid");
                    let (x, g) = (&points[visit.point as usize], &grad[visit.point as usize]);
                    let slope = cell.spread(volume, to_volume, visit.to_weight, sides);
                    for a in 0..3 {
                        let to_p = visit.share * g[a] + visit.to_weight * slope[a] * scale[a];
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

/// The visits of all points with a gradient, block by block.
///
/// # Panics
/// If the sizes do not match the grid or each other.
pub(super) fn all_visits(
    weights: &[f32],
    transforms: &[f32],
    points: &[f32],
    grad: &[f32],
    grid: &WarpGrid,
) -> Vec<Visits> {
    check(weights, transforms, points, grid);
    assert_eq!(grad.len() / 4, points.len() / 3, "rows of the gradient");
    let supports = supports(weights, transforms.len() / 12, grid);
    let (points, grad) = (points.as_chunks::<3>().0, grad.as_chunks::<4>().0);
    let active: Vec<u32> = (0..points.len() as u32)
        .filter(|&i| grad[i as usize] != [0.0; 4])
        .collect();
    active
        .par_chunks(BLOCK)
        .map_init(Block::new, |block, active| {
            visits(
                block, weights, transforms, points, grad, grid, &supports, active,
            )
        })
        .collect()
}

/// The visits of the points numbered `active`, at most a block of them.
#[allow(clippy::too_many_arguments)]
fn visits(
    block: &mut Block,
    weights: &[f32],
    transforms: &[f32],
    points: &[[f32; 3]],
    grad: &[[f32; 4]],
    grid: &WarpGrid,
    supports: &[Support],
    active: &[u32],
) -> Visits {
    let sides = grid.sides();
    let voxels = grid.voxels();
    let (min, scale) = (grid.min, grid.scale());
    let mut found = Visits {
        all: Vec::with_capacity(4 * active.len()),
        starts: vec![0],
    };
    // Sum of the weights and the weighted sum of the carried points.
    let mut sums = vec![[0f32; 4]; active.len()];
    block.fill(active.iter().map(|i| &points[*i as usize]));
    for ((bone, volume), support) in transforms
        .chunks_exact(12)
        .zip(weights.chunks_exact(voxels))
        .zip(supports)
    {
        block.visit(bone, support, |i, at| {
            if let Some(cell) = Cell::of(at, min, scale, sides) {
                let w = cell.sample(volume, sides);
                for a in 0..3 {
                    sums[i][a] += w * at[a];
                }
                sums[i][3] += w;
                found.all.push(Visit {
                    // Its number in the block, until the sums are known.
                    point: i as u32,
                    at,
                    share: w,
                    to_weight: 0.0,
                });
            }
        });
        found.starts.push(found.all.len());
    }
    let dot = |g: &[f32; 4], p: &[f32]| g[0] * p[0] + g[1] * p[1] + g[2] * p[2];
    for visit in &mut found.all {
        let i = visit.point as usize;
        let (g, sum) = (&grad[active[i] as usize], sums[i][3]);
        let divisor = sum.max(MIN_WEIGHT_SUM);
        let mean = dot(g, &sums[i][..3]) / divisor;
        let mut to_sum = if sum > MIN_WEIGHT_SUM {
            -mean / divisor
        } else {
            0.0
        };
        if (0.0..=1.0).contains(&sum) {
            to_sum += g[3];
        }
        visit.point = active[i];
        visit.share /= divisor;
        visit.to_weight = dot(g, &visit.at) / divisor + to_sum;
    }
    found
}
