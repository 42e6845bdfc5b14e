//! Gradients to points as their bones carry them, bone by bone: what is left of the backward pass
//! before it sums over points. A fit of a pose needs these sums per ray.

use super::WarpGrid;
use super::cpu::{check, visits};
use super::grid::{Cell, supports};
use super::visits::{BLOCK, Block};
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

/// The gradients to the carried points, from `grad` `[N, 4]` to the result of [`super::warp`].
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
) -> Vec<Pull> {
    check(weights, transforms, points, grid);
    assert_eq!(grad.len() / 4, points.len() / 3, "rows of the gradient");
    let d = grid.resolution as i32;
    let voxels = grid.resolution.pow(3);
    let bones = transforms.len() / 12;
    let (min, scale) = (grid.min, grid.scale());
    let supports = supports(weights, bones, grid);
    let (points, grad) = (points.as_chunks::<3>().0, grad.as_chunks::<4>().0);
    let active: Vec<u32> = (0..points.len() as u32)
        .filter(|&i| grad[i as usize] != [0.0; 4])
        .collect();
    let blocks: Vec<Vec<Pull>> = active
        .par_chunks(BLOCK)
        .map_init(Block::new, |block, active| {
            let found = visits(
                block, weights, transforms, points, grad, grid, &supports, active,
            );
            let mut pulls = Vec::with_capacity(found.all.len());
            for bone in 0..bones {
                let volume = &weights[bone * voxels..(bone + 1) * voxels];
                for visit in &found.all[found.starts[bone]..found.starts[bone + 1]] {
                    let Some(cell) = Cell::of(visit.at, min, scale, d) else {
                        continue;
                    };
                    let slope = cell.slope(volume, d);
                    let g = &grad[visit.point as usize];
                    let force = std::array::from_fn(|a| {
                        visit.share * g[a] + visit.to_weight * slope[a] * scale[a]
                    });
                    pulls.push(Pull {
                        point: visit.point,
                        bone: bone as u32,
                        force,
                    });
                }
            }
            pulls
        })
        .collect();
    blocks.concat()
}
