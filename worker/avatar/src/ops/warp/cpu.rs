//! The warp on CPU threads.
//!
//! Forward runs over blocks of points. Backward runs twice: over points, to find the bones
//! that weigh them and the gradient to each weight; then over bones, which own disjoint rows of
//! the volume, so that no thread adds to another's memory and the sums come out in one order
//! whatever the number of threads. Points that no gradient reaches take no part.

use super::grid::{Cell, Support, supports};
use super::visits::{BLOCK, Block};
use super::{MIN_WEIGHT_SUM, WarpGrid};
use rayon::prelude::*;

/// `[N, 4]` as in [`super::warp`].
pub fn forward(weights: &[f32], transforms: &[f32], points: &[f32], grid: &WarpGrid) -> Vec<f32> {
    let mut output = unlimited(weights, transforms, points, grid);
    for out in output.as_chunks_mut::<4>().0 {
        out[3] = out[3].clamp(0.0, 1.0);
    }
    output
}

/// The same with the plain sum of the weights, which can exceed 1, in the last place.
pub fn unlimited(weights: &[f32], transforms: &[f32], points: &[f32], grid: &WarpGrid) -> Vec<f32> {
    let d = grid.resolution as i32;
    let voxels = grid.resolution.pow(3);
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
                    if let Some(cell) = Cell::of(p, min, scale, d) {
                        let w = cell.sample(volume, d);
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

/// A point that a bone weighs.
struct Visit {
    point: u32,
    /// Where the bone carries it, canonical metres.
    at: [f32; 3],
    /// Share of the bone in the canonical point.
    share: f32,
    /// Gradient to the bone's weight.
    to_weight: f32,
}

/// The visits of a block of points, bone by bone.
struct Visits {
    all: Vec<Visit>,
    /// `[bones + 1]`: where those of each bone start.
    starts: Vec<usize>,
}

/// Gradients to weights (same shape) and transforms `[K, 12]`, from `grad` `[N, 4]`.
pub fn backward(
    weights: &[f32],
    transforms: &[f32],
    points: &[f32],
    grad: &[f32],
    grid: &WarpGrid,
) -> (Vec<f32>, Vec<f32>) {
    let d = grid.resolution as i32;
    let voxels = grid.resolution.pow(3);
    let bones = transforms.len() / 12;
    let (min, scale) = (grid.min, grid.scale());
    let supports = supports(weights, bones, grid);
    let (points, grad) = (points.as_chunks::<3>().0, grad.as_chunks::<4>().0);
    let felt: Vec<u32> = (0..points.len() as u32)
        .filter(|&i| grad[i as usize] != [0.0; 4])
        .collect();
    let blocks: Vec<Visits> = felt
        .par_chunks(BLOCK)
        .map_init(Block::new, |block, felt| {
            visits(
                block, weights, transforms, points, grad, grid, &supports, felt,
            )
        })
        .collect();

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
                    let Some(cell) = Cell::of(visit.at, min, scale, d) else {
                        continue;
                    };
                    let (x, g) = (&points[visit.point as usize], &grad[visit.point as usize]);
                    let slope = cell.spread(volume, to_volume, visit.to_weight, d);
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

/// The visits of the points numbered `felt`, at most a block of them.
#[allow(clippy::too_many_arguments)]
fn visits(
    block: &mut Block,
    weights: &[f32],
    transforms: &[f32],
    points: &[[f32; 3]],
    grad: &[[f32; 4]],
    grid: &WarpGrid,
    supports: &[Support],
    felt: &[u32],
) -> Visits {
    let d = grid.resolution as i32;
    let voxels = grid.resolution.pow(3);
    let (min, scale) = (grid.min, grid.scale());
    let mut found = Visits {
        all: Vec::with_capacity(4 * felt.len()),
        starts: vec![0],
    };
    // Sum of the weights and the weighted sum of the carried points.
    let mut sums = vec![[0f32; 4]; felt.len()];
    block.fill(felt.iter().map(|i| &points[*i as usize]));
    for ((bone, volume), support) in transforms
        .chunks_exact(12)
        .zip(weights.chunks_exact(voxels))
        .zip(supports)
    {
        block.visit(bone, support, |i, at| {
            if let Some(cell) = Cell::of(at, min, scale, d) {
                let w = cell.sample(volume, d);
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
        let (g, sum) = (&grad[felt[i] as usize], sums[i][3]);
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
        visit.point = felt[i];
        visit.share /= divisor;
        visit.to_weight = dot(g, &visit.at) / divisor + to_sum;
    }
    found
}
