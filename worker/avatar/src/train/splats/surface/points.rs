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
    /// `count` of the points that are `wanted`, evenly in their order, of which each stands for `area`, square metres. Some are given twice if
    /// there are fewer.
    pub(in crate::train::splats) fn thinned(
        &self,
        wanted: impl Fn(usize) -> bool,
        count: usize,
        area: f64,
    ) -> Self {
        let all: Vec<usize> = (0..self.points.len()).filter(|i| wanted(*i)).collect();
        let count = if all.is_empty() { 0 } else { count };
        let chosen = (0..count).map(|i| all[i * all.len() / count]);
        let spacing = (area * all.len() as f64 / count.max(1) as f64).sqrt();
        Self {
            points: chosen.clone().map(|i| self.points[i]).collect(),
            normals: chosen.clone().map(|i| self.normals[i]).collect(),
            skinning: chosen.map(|i| self.skinning[i]).collect(),
            spacing: vec![spacing; count],
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
