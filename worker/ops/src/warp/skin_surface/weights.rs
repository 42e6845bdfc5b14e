//! The skinning weights of a surface's points for pictures, which are looked up once for all poses.

use super::super::skin::weights::SkinningWeights;
use super::WarpGrid;
use super::surface::Surface;
use rayon::prelude::*;

/// Points per task.
const BLOCK: usize = 512;

impl SkinningWeights {
    /// The skinning weights of canonical `points` `[N, 3]` of a surface with `width` bones per point, as in
    /// [`super::skin_surface`]: `factors` `[C, V]` of the first `factored` bones, `bones` `[N, width]` and base `weights` `[N, width]`.
    ///
    /// # Panics
    /// As [`Surface::new`], and if `points` are not as many as `bones` has rows.
    pub fn of_surface(
        factors: &[f32],
        factored: usize,
        points: &[f32],
        bones: &[f32],
        weights: &[f32],
        width: usize,
        grid: &WarpGrid,
    ) -> Self {
        let surface = Surface::new(factors, factored, bones, weights, width, grid);
        let points = points.as_chunks::<3>().0;
        assert_eq!(points.len(), surface.points(), "points of the surface");
        let lists = points
            .par_iter()
            .with_min_len(BLOCK)
            .enumerate()
            .map(|(i, at)| {
                let weights = surface.weights_at(i, *at);
                let shares = weights.shares().iter();
                shares.map(|share| (share.bone, share.weight)).collect()
            })
            .collect();
        Self::from_lists(lists)
    }
}
