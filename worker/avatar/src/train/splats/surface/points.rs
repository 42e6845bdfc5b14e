//! Points of a person's surface, where splats start.

use crate::field::splats::SurfaceSkinning;

/// Points of a person's surface in the rest pose.
#[derive(Default)]
pub(in crate::train::splats) struct SurfacePoints {
    /// `[N, 3]`, metres.
    pub points: Vec<[f32; 3]>,
    /// `[N, 3]`, unit vectors, outward.
    pub normals: Vec<[f32; 3]>,
    /// `[N]`, the distance to the next point, metres.
    pub spacing: Vec<f64>,
    /// `[N]`: whether points are sparse here, as where no frame faces the surface.
    pub sparse: Vec<bool>,
    /// `[N]`: bones and weights; empty where the prior of motion weights has them.
    pub skinning: Vec<[(u8, f32); 4]>,
}

impl SurfacePoints {
    /// `count` of the points in their order. Each point stands for `area`, square metres, and is chosen in proportion to its `density`. A
    /// point may be given twice. Points that are denser than 1 have the spacing of those that are not: their splats overlap.
    pub(in crate::train::splats) fn thinned(
        &self,
        density: impl Fn(usize) -> f64,
        count: usize,
        area: f64,
    ) -> Self {
        let total: f64 = (0..self.points.len()).map(&density).sum();
        let each = total / count.max(1) as f64;
        let mut thinned = Self::default();
        let mut before = 0.0;
        for i in 0..self.points.len() {
            let own = density(i);
            before += own;
            while own > 0.0
                && thinned.points.len() < count
                && (thinned.points.len() as f64 + 0.5) * each <= before
            {
                thinned.points.push(self.points[i]);
                thinned.normals.push(self.normals[i]);
                thinned.skinning.push(self.skinning[i]);
                thinned.spacing.push((area * each / own.min(1.0)).sqrt());
                thinned.sparse.push(own < 1.0);
            }
        }
        thinned
    }

    pub(in crate::train::splats) fn append(&mut self, other: Self) {
        self.points.extend(other.points);
        self.normals.extend(other.normals);
        self.spacing.extend(other.spacing);
        self.sparse.extend(other.sparse);
        self.skinning.extend(other.skinning);
    }

    /// Bones and weights as splats have them; `None` where the prior of motion weights has them.
    pub(in crate::train::splats) fn skinning(&self) -> Option<SurfaceSkinning> {
        let all = self.skinning.iter().flatten();
        (!self.skinning.is_empty()).then(|| SurfaceSkinning {
            bones: all.clone().map(|(bone, _)| f32::from(*bone)).collect(),
            weights: all.map(|(_, weight)| *weight).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_a_quarter_of_the_density_are_twice_as_far_apart() {
        let points = SurfacePoints {
            points: (0..300).map(|i| [i as f32, 0.0, 0.0]).collect(),
            normals: vec![[0.0, 1.0, 0.0]; 300],
            skinning: vec![[(0, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)]; 300],
            ..SurfacePoints::default()
        };
        let density = |i: usize| [0.0, 0.25, 1.0][i / 100];
        let thinned = points.thinned(density, 50, 1e-4);
        let sparse = |at: &&[f32; 3]| at[0] < 200.0;
        assert_eq!(thinned.points.len(), 50);
        assert_eq!(thinned.points.iter().filter(sparse).count(), 10);
        assert!(thinned.points.iter().all(|at| at[0] >= 100.0));
        // 125 points' worth of area is shared by 50.
        let apart = |area: f64| (area * 2.5).sqrt();
        assert!((thinned.spacing[0] - 2.0 * apart(1e-4)).abs() < 1e-9);
        assert!((thinned.spacing[49] - apart(1e-4)).abs() < 1e-9);
        assert!(thinned.sparse[0] && !thinned.sparse[49]);
        let doubled = points.thinned(|i| [2.0, 1.0, 0.0][i / 100], 30, 1e-4);
        assert_eq!(doubled.points.iter().filter(|at| at[0] < 100.0).count(), 20);
        assert!((doubled.spacing[0] - doubled.spacing[29]).abs() < 1e-9);
        let none = points.thinned(|_| 0.0, 50, 1e-4);
        assert!(none.points.is_empty());
    }
}
