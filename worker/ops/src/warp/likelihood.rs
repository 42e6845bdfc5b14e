//! Canonical points and foreground likelihoods of samples along rays, without gradients. They decide
//! which samples are evaluated at all.
//!
//! The support of a bone is a box in canonical space, and a ray that the bone transforms is still a ray. One slab
//! test therefore finds the few samples of a ray that are in the support, and only these are transformed.

use super::grid::{Cell, Support, supports};
use super::{MIN_WEIGHT_SUM, WarpGrid};
use rayon::prelude::*;

/// Rays per task.
const BLOCK: usize = 64;

/// The part of a ray that samples are on. Distances are multiples of its direction.
#[derive(Clone, Copy, Debug)]
pub struct Segment {
    /// Metres, body frame.
    pub origin: [f32; 3],
    /// Any length.
    pub direction: [f32; 3],
    /// Start of the first stratum.
    pub near: f32,
    /// End of the last stratum.
    pub far: f32,
}

/// Canonical points and likelihoods, as [`super::warp`] returns them, of the samples at `depths`
/// `[R M]`: M on each segment, one in each of M equal strata. `weights` and `transforms` as for
/// [`super::warp`]. Returns the results of `finish` in the order of the rays. `finish` gets the index of a block's first
/// ray and the block's samples. Most samples are usually zeros, since no bone has a weight there.
///
/// # Panics
/// If the number of `depths` is not a multiple of the number of segments.
pub fn along_rays<T: Send>(
    weights: &[f32],
    transforms: &[f32],
    segments: &[Segment],
    depths: &[f32],
    grid: &WarpGrid,
    finish: impl Fn(usize, &[[f32; 4]]) -> T + Sync,
) -> Vec<T> {
    if segments.is_empty() || depths.is_empty() {
        return Vec::new();
    }
    assert!(
        depths.len().is_multiple_of(segments.len()),
        "{} depths on {} segments: not equally many on each",
        depths.len(),
        segments.len()
    );
    let per_ray = depths.len() / segments.len();
    let sides = grid.sides();
    let voxels = grid.voxels();
    let (min, scale) = (grid.min, grid.scale());
    let supports = supports(weights, transforms.len() / 12, grid);
    let blocks = depths
        .par_chunks(BLOCK * per_ray)
        .zip(segments.par_chunks(BLOCK))
        .enumerate();
    let warp_block = |warped: &mut Vec<[f32; 4]>, depths: &[f32], segments: &[Segment]| {
        warped.clear();
        warped.resize(depths.len(), [0.0; 4]);
        for ((bone, volume), support) in transforms
            .chunks_exact(12)
            .zip(weights.chunks_exact(voxels))
            .zip(&supports)
        {
            let rays = warped
                .chunks_exact_mut(per_ray)
                .zip(depths.chunks_exact(per_ray));
            for ((warped, depths), segment) in rays.zip(segments) {
                let rotate = |v: [f32; 3], r: usize| {
                    bone[4 * r] * v[0] + bone[4 * r + 1] * v[1] + bone[4 * r + 2] * v[2]
                };
                let origin: [f32; 3] =
                    std::array::from_fn(|r| rotate(segment.origin, r) + bone[4 * r + 3]);
                let direction: [f32; 3] = std::array::from_fn(|r| rotate(segment.direction, r));
                let Some((from, to)) = inside(support, origin, direction, segment) else {
                    continue;
                };
                let strata = per_ray as f32 / (segment.far - segment.near);
                let first = ((from - segment.near) * strata) as usize;
                let last = (((to - segment.near) * strata) as usize + 1).min(per_ray);
                for m in first.min(last)..last {
                    let t = depths[m];
                    let p: [f32; 3] = std::array::from_fn(|a| origin[a] + t * direction[a]);
                    // The first and last strata extend beyond the support.
                    if !support.contains(p) {
                        continue;
                    }
                    if let Some(cell) = Cell::of(p, min, scale, sides) {
                        let w = cell.sample(volume, sides);
                        for a in 0..3 {
                            warped[m][a] += w * p[a];
                        }
                        warped[m][3] += w;
                    }
                }
            }
        }
        for [x, y, z, sum] in warped {
            if *sum == 0.0 {
                continue;
            }
            let divisor = sum.max(MIN_WEIGHT_SUM);
            for value in [x, y, z] {
                *value /= divisor;
            }
            *sum = sum.clamp(0.0, 1.0);
        }
    };
    blocks
        .map_init(Vec::new, |warped, (block, (depths, segments))| {
            warp_block(warped, depths, segments);
            finish(block * BLOCK, warped)
        })
        .collect()
}

/// The part of a segment inside a support, by slabs; `None` if it is empty.
fn inside(
    support: &Support,
    origin: [f32; 3],
    direction: [f32; 3],
    segment: &Segment,
) -> Option<(f32, f32)> {
    let (mut from, mut to) = (segment.near, segment.far);
    for a in 0..3 {
        let (low, high) = (support.min[a] - origin[a], support.max[a] - origin[a]);
        // Parallel to the slab, the quotients are ±∞, or NaN on its border, which min and max
        // ignore.
        let (one, other) = (low / direction[a], high / direction[a]);
        from = from.max(one.min(other));
        to = to.min(one.max(other));
    }
    (from < to).then_some((from, to))
}
