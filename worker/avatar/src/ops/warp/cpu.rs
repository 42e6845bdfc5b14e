//! The warp on CPU threads.
//!
//! Forward runs over blocks of points. Backward runs twice: over points, to turn the output's
//! gradient into one number a bone and point; then over bones, which own disjoint rows of the
//! volume, so that no thread adds to another's memory and the sums come out in one order
//! whatever the number of threads.

use super::grid::{Cell, carry, supports};
use super::{MIN_WEIGHT_SUM, WarpGrid};
use rayon::prelude::*;

/// Points a task: enough to hide the hand-over, few enough to share evenly.
const BLOCK: usize = 512;

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
    let mut output = vec![0f32; points.len() / 3 * 4];
    output
        .par_chunks_mut(4 * BLOCK)
        .zip(points.par_chunks(3 * BLOCK))
        .for_each(|(output, points)| {
            for ((bone, volume), support) in transforms
                .chunks_exact(12)
                .zip(weights.chunks_exact(voxels))
                .zip(&supports)
            {
                for (out, point) in output.chunks_exact_mut(4).zip(points.chunks_exact(3)) {
                    let p = carry(bone, point);
                    if !support.contains(p) {
                        continue;
                    }
                    if let Some(cell) = Cell::of(p, min, scale, d) {
                        let w = cell.sample(volume, d);
                        for a in 0..3 {
                            out[a] += w * p[a];
                        }
                        out[3] += w;
                    }
                }
            }
            for out in output.chunks_exact_mut(4) {
                let divisor = out[3].max(MIN_WEIGHT_SUM);
                for value in &mut out[..3] {
                    *value /= divisor;
                }
            }
        });
    output
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
    let n = points.len() / 3;
    let (min, scale) = (grid.min, grid.scale());

    let supports = supports(weights, bones, grid);

    // For each point and bone: the bone's weight, and the gradient to it.
    let mut shares = vec![[0f32; 2]; n * bones];
    shares
        .par_chunks_mut(bones * BLOCK)
        .enumerate()
        .for_each(|(block, shares)| {
            for (i, shares) in shares.chunks_exact_mut(bones).enumerate() {
                let i = block * BLOCK + i;
                let (x, g) = (&points[3 * i..3 * i + 3], &grad[4 * i..4 * i + 4]);
                let (mut sum, mut mean) = (0f32, [0f32; 3]);
                for (bone, share) in shares.iter_mut().enumerate() {
                    let p = carry(&transforms[12 * bone..12 * bone + 12], x);
                    if !supports[bone].contains(p) {
                        continue;
                    }
                    if let Some(cell) = Cell::of(p, min, scale, d) {
                        let w = cell.sample(&weights[bone * voxels..(bone + 1) * voxels], d);
                        // The dot product of gradient and carried point waits in the second place.
                        *share = [w, g[0] * p[0] + g[1] * p[1] + g[2] * p[2]];
                        sum += w;
                        for a in 0..3 {
                            mean[a] += w * p[a];
                        }
                    }
                }
                let divisor = sum.max(MIN_WEIGHT_SUM);
                let along = (g[0] * mean[0] + g[1] * mean[1] + g[2] * mean[2]) / divisor;
                let to_sum = if sum > MIN_WEIGHT_SUM {
                    -along / divisor
                } else {
                    0.0
                } + if (0.0..=1.0).contains(&sum) {
                    g[3]
                } else {
                    0.0
                };
                for share in shares {
                    // A point outside this bone's box has no taps there: its gradient goes nowhere.
                    share[1] = share[1] / divisor + to_sum;
                    share[0] /= divisor;
                }
            }
        });

    let mut to_weights = vec![0f32; weights.len()];
    let mut to_transforms = vec![0f32; bones * 12];
    to_weights
        .par_chunks_mut(voxels)
        .zip(to_transforms.par_chunks_mut(12))
        .enumerate()
        .for_each(|(bone, (to_volume, to_transform))| {
            let transform = &transforms[12 * bone..12 * bone + 12];
            let volume = &weights[bone * voxels..(bone + 1) * voxels];
            for i in 0..n {
                let (x, g) = (&points[3 * i..3 * i + 3], &grad[4 * i..4 * i + 4]);
                let [share, to_weight] = shares[i * bones + bone];
                let p = carry(transform, x);
                if !supports[bone].contains(p) {
                    continue;
                }
                let Some(cell) = Cell::of(p, min, scale, d) else {
                    continue;
                };
                let mut slope = [0f32; 3];
                cell.taps(d, |index, tap, by_offset| {
                    to_volume[index] += tap * to_weight;
                    for a in 0..3 {
                        slope[a] += by_offset[a] * volume[index];
                    }
                });
                for a in 0..3 {
                    let to_p = share * g[a] + to_weight * slope[a] * scale[a];
                    for (c, to) in to_transform[4 * a..4 * a + 3].iter_mut().enumerate() {
                        *to += to_p * x[c];
                    }
                    to_transform[4 * a + 3] += to_p;
                }
            }
        });
    (to_weights, to_transforms)
}
