//! Gradients to points as their bones carry them, bone by bone: what is left of the backward pass
//! before it sums over points. A fit of a pose needs these sums per ray.

use super::WarpGrid;
use super::cpu::all_visits;
use super::grid::Cell;
use rayon::prelude::*;

/// Gradient to one point as one bone carries it.
#[derive(Clone, Copy, Debug)]
pub struct Pull {
    /// Number of the point.
    pub point: u32,
    /// Number of the bone.
    pub bone: u32,
    /// Along the canonical axes.
    pub force: [f32; 3],
}

/// The gradients to the carried points, in blocks of points that follow each other, from `grad` `[N, 4]` to the result of [`super::warp`].
/// Points without a gradient, and bones without a weight, have none.
///
/// # Panics
/// If the sizes do not match the grid or each other.
pub fn pulls(
    weights: &[f32],
    transforms: &[f32],
    points: &[f32],
    grad: &[f32],
    grid: &WarpGrid,
) -> Vec<Vec<Pull>> {
    let sides = grid.sides();
    let voxels = grid.voxels();
    let scale = grid.scale();
    let (grad, _) = grad.as_chunks::<4>();
    let blocks = all_visits(weights, transforms, points, grad.as_flattened(), grid);
    (blocks.par_iter())
        .map(|block| {
            let mut pulls = Vec::with_capacity(block.all.len());
            let bones = block.starts.windows(2).zip(weights.chunks_exact(voxels));
            for (bone, (range, volume)) in (0..).zip(bones) {
                for visit in &block.all[range[0]..range[1]] {
                    let Some(cell) = Cell::of(visit.at, grid.min, scale, sides) else {
                        continue;
                    };
                    let slope = cell.slope(volume, sides);
                    let g = &grad[visit.point as usize];
                    let force = std::array::from_fn(|a| {
                        visit.share * g[a] + visit.to_weight * slope[a] * scale[a]
                    });
                    pulls.push(Pull {
                        point: visit.point,
                        bone,
                        force,
                    });
                }
            }
            pulls
        })
        .collect()
}
