//! Influences of bones on points that forward skinning moves. Backward passes find them point by point and sum
//! gradients bone by bone, so that the order of sums does not depend on the number of threads.

use super::WarpGrid;
use super::grid::Cell;
use rayon::prelude::*;

/// A bone with a weight at a point.
pub(super) struct Influence {
    pub point: u32,
    /// Its normalised weight wᵢ in the blend.
    pub weight: f32,
    /// Gradient to the value of the bone's volume at the point.
    pub to_value: f32,
}

/// Influences of a block of points, bone by bone.
pub(super) type Influences = Vec<Vec<Influence>>;

/// Influences of all points.
pub(super) struct AllInfluences<'a> {
    /// In the order of the points.
    pub blocks: &'a [Influences],
    /// Gradient `[N, 12]` to the blended transforms.
    pub grad: &'a [[f32; 12]],
    /// Posed to canonical of each bone `[K, 12]`.
    pub bones: &'a [[f32; 12]],
    /// Volumes `[C, V]`, the first those of the bones; bones may lack one.
    pub volumes: &'a [f32],
    pub grid: &'a WarpGrid,
}

impl AllInfluences<'_> {
    /// The gradients to the volumes `[C, V]` and to the posed-to-canonical transforms `[K, 12]`. `cell` finds the cell
    /// of a point by its index.
    pub(super) fn sum_by_bone(
        &self,
        cell: impl Fn(usize) -> Option<Cell> + Sync,
    ) -> (Vec<f32>, Vec<f32>) {
        let (voxels, sides) = (self.grid.voxels(), self.grid.sides());
        let mut to_volumes = vec![0f32; self.volumes.len()];
        let mut to_transforms = vec![0f32; 12 * self.bones.len()];
        let volumes = to_volumes.chunks_mut(voxels).map(Some);
        let volumes: Vec<_> = volumes
            .chain(std::iter::repeat_with(|| None))
            .take(self.bones.len())
            .collect();
        volumes
            .into_par_iter()
            .zip(to_transforms.par_chunks_mut(12))
            .enumerate()
            .for_each(|(bone, (mut to_volume, to_transform))| {
                let mut to_forward = [0f32; 12];
                for influence in self.blocks.iter().flat_map(|block| &block[bone]) {
                    let point = influence.point as usize;
                    for (to, from) in to_forward.iter_mut().zip(&self.grad[point]) {
                        *to += influence.weight * from;
                    }
                    if influence.to_value != 0.0
                        && let Some(to_volume) = &mut to_volume
                        && let Some(cell) = cell(point)
                    {
                        let volume = &self.volumes[bone * voxels..(bone + 1) * voxels];
                        cell.spread(volume, to_volume, influence.to_value, sides);
                    }
                }
                rigid_inverse_backward(&self.bones[bone], &to_forward, to_transform);
            });
        (to_volumes, to_transforms)
    }
}

/// The product of all numbers of two transforms.
#[inline(always)]
pub(super) fn dot(a: &[f32; 12], b: &[f32; 12]) -> f32 {
    let mut sums = [0f32; 4];
    for (a, b) in a.as_chunks::<4>().0.iter().zip(b.as_chunks::<4>().0) {
        for lane in 0..4 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}

/// Adds the gradient to a bone's posed-to-canonical transform [R, t], from the gradient `to_inverse` to its inverse
/// [Rᵀ, s] with s = −Rᵀ t: ∂L/∂R = (∂L/∂Rᵀ)ᵀ − t (∂L/∂s)ᵀ, ∂L/∂t = −R ∂L/∂s.
fn rigid_inverse_backward(bone: &[f32; 12], to_inverse: &[f32; 12], to: &mut [f32]) {
    for a in 0..3 {
        let shift = bone[4 * a + 3];
        for b in 0..3 {
            let to_shift = to_inverse[4 * b + 3];
            to[4 * a + b] += to_inverse[4 * b + a] - to_shift * shift;
            to[4 * a + 3] -= to_shift * bone[4 * a + b];
        }
    }
}
