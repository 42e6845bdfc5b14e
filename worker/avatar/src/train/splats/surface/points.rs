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
    /// `[N]`: bones and weights; empty where the prior of motion weights has them.
    pub skinning: Vec<[(u8, f32); 4]>,
}

impl SurfacePoints {
    /// The points with these `indices`, `spacing` apart.
    pub(in crate::train::splats) fn chosen(&self, indices: &[usize], spacing: Vec<f64>) -> Self {
        Self {
            points: indices.iter().map(|i| self.points[*i]).collect(),
            normals: indices.iter().map(|i| self.normals[*i]).collect(),
            skinning: indices.iter().map(|i| self.skinning[*i]).collect(),
            spacing,
        }
    }

    pub(in crate::train::splats) fn append(&mut self, other: Self) {
        self.points.extend(other.points);
        self.normals.extend(other.normals);
        self.spacing.extend(other.spacing);
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

/// `count` of `points` points in their order, and the distance of each to the next, metres. Each point stands for `area`, square metres, and
/// is chosen in proportion to its `density`. A point may be given twice.
pub(in crate::train::splats) fn thinned(
    points: usize,
    density: impl Fn(usize) -> f64,
    count: usize,
    area: f64,
) -> (Vec<usize>, Vec<f64>) {
    let total: f64 = (0..points).map(&density).sum();
    let each = total / count.max(1) as f64;
    let (mut chosen, mut spacing) = (Vec::new(), Vec::new());
    let mut before = 0.0;
    for i in 0..points {
        let own = density(i);
        before += own;
        while own > 0.0 && chosen.len() < count && (chosen.len() as f64 + 0.5) * each <= before {
            chosen.push(i);
            spacing.push((area * each / own).sqrt());
        }
    }
    (chosen, spacing)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_a_quarter_of_the_density_are_twice_as_far_apart() {
        let density = |i: usize| [0.0, 0.25, 1.0][i / 100];
        let (chosen, spacing) = thinned(300, density, 50, 1e-4);
        assert_eq!(chosen.len(), 50);
        assert_eq!(chosen.iter().filter(|i| **i < 200).count(), 10);
        assert!(chosen.iter().all(|i| *i >= 100));
        // 125 points' worth of area is shared by 50.
        let apart = |area: f64| (area * 2.5).sqrt();
        assert!((spacing[0] - 2.0 * apart(1e-4)).abs() < 1e-9);
        assert!((spacing[49] - apart(1e-4)).abs() < 1e-9);
        let (none, _) = thinned(300, |_| 0.0, 50, 1e-4);
        assert!(none.is_empty());
    }
}
