//! Which joints can move the clothes at a place: those whose own bones are near, or that are near themselves. A skirt
//! follows the hip, whose thigh is beside it, and not the knee at the thigh's end.

use rayon::prelude::*;
use yoto_capture::skeleton::{Skeleton, Vec3};

/// Nearness below which a joint counts as far.
const FAR: f32 = 1e-3;
/// Places per task.
const BLOCK: usize = 512;

/// The joints in the rest pose, and the bones that each turns.
pub(crate) struct Nearness {
    joints: Vec<[f32; 3]>,
    /// Joint, start, and way to the child.
    bones: Vec<(usize, [f32; 3], [f32; 3])>,
    /// Distance at which the nearness is e^(−1/2), metres.
    reach: f32,
}

impl Nearness {
    /// Of a body whose joints are at `rest`. At the distance `reach`, metres, the nearness is e^(−1/2).
    pub fn new(skeleton: &Skeleton, rest: &[Vec3], reach: f32) -> Self {
        let joints: Vec<[f32; 3]> = rest.iter().map(|at| at.map(|v| v as f32)).collect();
        let children = skeleton.parents.iter().enumerate();
        let bones = children.filter_map(|(child, parent)| {
            let parent = (*parent)?;
            let (from, to) = (joints[parent], joints[child]);
            Some((parent, from, std::array::from_fn(|a| to[a] - from[a])))
        });
        Self {
            bones: bones.collect(),
            joints,
            reach,
        }
    }

    /// K.
    pub fn joints(&self) -> usize {
        self.joints.len()
    }

    /// Distance at which the nearness is e^(−1/2), metres.
    pub fn reach(&self) -> f32 {
        self.reach
    }

    /// aₖ of each joint at a place, into `row` `[K]`: exp(−d²/2r²) of the distance to the joint and its bones.
    fn fill(&self, row: &mut [f32], at: [f32; 3]) {
        for (to, joint) in row.iter_mut().zip(&self.joints) {
            *to = squared(std::array::from_fn(|a| at[a] - joint[a]));
        }
        for (joint, from, way) in &self.bones {
            let off: [f32; 3] = std::array::from_fn(|a| at[a] - from[a]);
            let along = (0..3).map(|a| off[a] * way[a]).sum::<f32>() / squared(*way).max(1e-9);
            let along = along.clamp(0.0, 1.0);
            let distance = squared(std::array::from_fn(|a| off[a] - along * way[a]));
            row[*joint] = row[*joint].min(distance);
        }
        let scale = -0.5 / (self.reach * self.reach);
        for value in row {
            let nearness = (scale * *value).exp();
            *value = if nearness < FAR { 0.0 } else { nearness };
        }
    }

    /// aₖ(x) `[N, K]` at `places` `[N, 3]`.
    pub fn dense(&self, places: &[f32]) -> Vec<f32> {
        let joints = self.joints.len();
        let places = places.as_chunks::<3>().0;
        let mut all = vec![0f32; joints * places.len()];
        let rows = all.par_chunks_mut(joints).zip(places);
        let rows = rows.with_min_len(BLOCK);
        rows.for_each(|(row, at)| self.fill(row, *at));
        all
    }
}

fn squared([x, y, z]: [f32; 3]) -> f32 {
    x * x + y * y + z * z
}
