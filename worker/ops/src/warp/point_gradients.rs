//! Gradients to the points that bones transform, bone by bone: the backward pass of the warp before it sums
//! over points. A fit of a pose needs these sums per ray.

use super::WarpGrid;
use super::cpu::all_influences;
use super::grid::Cell;
use rayon::prelude::*;

/// Gradient to one point that one bone has transformed.
#[derive(Clone, Copy, Debug)]
pub struct PointGradient {
    /// Index of the point.
    pub point: u32,
    /// Index of the bone.
    pub bone: u32,
    /// ∂L/∂pₖ along the canonical axes.
    pub gradient: [f32; 3],
}

/// The gradients to the transformed points from the gradient `grad` `[N, 4]` to the result of [`super::warp`], in
/// blocks of consecutive points. Points whose gradient is 0 and bones without a weight there have no entry.
///
/// # Panics
/// If the sizes do not match the grid or each other.
pub fn point_gradients(
    weights: &[f32],
    transforms: &[f32],
    points: &[f32],
    grad: &[f32],
    grid: &WarpGrid,
) -> Vec<Vec<PointGradient>> {
    let sides = grid.sides();
    let voxels = grid.voxels();
    let scale = grid.scale();
    let (grad, _) = grad.as_chunks::<4>();
    let blocks = all_influences(weights, transforms, points, grad.as_flattened(), grid);
    (blocks.par_iter())
        .map(|block| {
            let mut point_gradients = Vec::with_capacity(block.all.len());
            let bones = block.starts.windows(2).zip(weights.chunks_exact(voxels));
            for (bone, (range, volume)) in (0..).zip(bones) {
                for influence in &block.all[range[0]..range[1]] {
                    let Some(cell) = Cell::of(influence.at, grid.min, scale, sides) else {
                        continue;
                    };
                    let slope = cell.slope(volume, sides);
                    let g = &grad[influence.point as usize];
                    // ∂L/∂pₖ = wₖ / s ∂L/∂c + ∂L/∂wₖ ∇Wₖ(pₖ)
                    let gradient = std::array::from_fn(|a| {
                        influence.weight * g[a] + influence.to_weight * slope[a] * scale[a]
                    });
                    point_gradients.push(PointGradient {
                        point: influence.point,
                        bone,
                        gradient,
                    });
                }
            }
            point_gradients
        })
        .collect()
}
