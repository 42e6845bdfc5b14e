//! Skirts and coats. Their cloth hangs over both legs, so that it belongs to neither: its weights are smooth from one leg to the other, and
//! it is stretched between legs that are apart. A body's own weights would split it into two trouser legs.

use super::between_legs::{LEGS, Legs};
use super::points::SurfacePoints;
use crate::train::splats::hull::HullFrames;
use rayon::prelude::*;
use tracing::debug;
use yoto_body::person::fit::FittedBody;
use yoto_body::person::sample::strongest;
use yoto_body::{Body, WITH_FACE};

/// Joints whose surface a skirt hangs over.
const LOWER_BODY: [u8; 5] = [0, 1, 2, 4, 5];
/// Least distance of a hem below the hips, metres: thighs touch above it.
const SHORTEST: f32 = 0.18;
/// Least mean distance of the surface from the bare body in the upper half of a skirt, metres: stout thighs touch in all frames, and
/// trousers lie closer (docs/research/body.md).
const STANDS_OFF: f32 = 0.0075;
/// Standard deviation of the mean of weights, metres.
const SMOOTH: f32 = 0.08;
/// How far above the hips weights count in that mean, metres.
const ABOVE: f32 = 0.1;
/// How many times as dense splats are midway between the legs, where poses stretch the cloth most, if a person has [`MANY`] splats.
const STRETCH: f64 = 7.0;
/// Fewer splats are larger, leave no gaps, and are needed elsewhere.
const MANY: f64 = 20_000.0;

/// Four bones and their weights.
type Bones = [(u8, f32); 4];

/// The heights of a skirt's ends in the rest pose, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::train::splats) struct Skirt {
    hem: f32,
    hips: f32,
}

impl Skirt {
    /// The skirt of the person of `hull`, whose `joints` in the rest pose are SMPL's, and whom the body is `fitted` to. `None` of people in
    /// trousers, and if the film does not tell.
    pub(super) fn find(
        body: &Body,
        joints: &[[f32; 3]],
        fitted: &FittedBody,
        hull: &HullFrames<'_>,
    ) -> Option<Self> {
        let legs = Legs::new(joints);
        let skirt = Self {
            hem: legs.closed_above(body, &fitted.bare, hull)?,
            hips: legs.hips(),
        };
        let thickness = skirt.thickness(body, fitted);
        debug!(?skirt, thickness, "between the legs");
        let long = skirt.hips - skirt.hem >= SHORTEST;
        (long && thickness >= STANDS_OFF).then_some(skirt)
    }

    /// The mean height of the surface above the bare legs in the upper half, metres.
    fn thickness(self, body: &Body, fitted: &FittedBody) -> f32 {
        let middle = 0.5 * (self.hips + self.hem);
        let all = fitted.heights.iter().zip(&fitted.bare).zip(&body.bones);
        let (mut sum, mut count) = (0.0, 0);
        for ((height, at), bones) in all {
            if LEGS.as_flattened().contains(&bones[0]) && (middle..self.hips).contains(&at[1]) {
                sum += height;
                count += 1;
            }
        }
        sum / count.max(1) as f32
    }

    /// Hangs the skirt's points of the body's surface and of what is beside it from both legs: their weights are the mean of those around
    /// them.
    pub(in crate::train::splats) fn hang(self, parts: [&mut SurfacePoints; 2]) {
        let within = |highest: f32| {
            move |at: &[f32; 3], own: &Bones| {
                (self.hem..highest).contains(&at[1]) && LOWER_BODY.contains(&own[0].0)
            }
        };
        let (around, own) = (within(self.hips + ABOVE), within(self.hips));
        let known: Vec<([f32; 3], Bones)> = (parts.iter())
            .flat_map(|part| {
                part.points
                    .iter()
                    .copied()
                    .zip(part.skinning.iter().copied())
            })
            .filter(|(at, skinning)| around(at, skinning))
            .collect();
        for part in parts {
            let points = part.points.par_iter();
            (part.skinning.par_iter_mut().zip(points))
                .filter(|(skinning, at)| own(at, skinning))
                .for_each(|(skinning, at)| *skinning = mean(&known, *at));
        }
    }

    /// How many times as dense splats with these bones and weights are as those of cloth that does not stretch. The person has `count`
    /// splats.
    pub(in crate::train::splats) fn density(skinning: &Bones, count: usize) -> f64 {
        let [left, right] = LEGS.map(|leg| {
            let own = skinning.iter().filter(|(bone, _)| leg.contains(bone));
            own.map(|(_, weight)| f64::from(*weight)).sum::<f64>()
        });
        let many = (count as f64 / MANY).min(1.0);
        1.0 + (STRETCH - 1.0) * many * 4.0 * left * right
    }
}

/// The mean of weights around a point.
fn mean(known: &[([f32; 3], Bones)], at: [f32; 3]) -> Bones {
    let mut sums = [0f32; WITH_FACE];
    for (other, skinning) in known {
        let square: f32 = (0..3).map(|a| (other[a] - at[a]).powi(2)).sum();
        let near = (-0.5 * square / (SMOOTH * SMOOTH)).exp();
        for (bone, weight) in skinning {
            sums[usize::from(*bone)] += near * weight;
        }
    }
    strongest((0..).zip(sums))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of two legs that touch.
    fn thighs() -> SurfacePoints {
        let mut points = SurfacePoints::default();
        for level in 0..60 {
            for across in -10..=10 {
                let at = [0.01 * across as f32, 0.5 + 0.01 * level as f32, 0.1];
                let bone = if across > 0 { 1 } else { 2 };
                points.points.push(at);
                points
                    .skinning
                    .push([(bone, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)]);
            }
        }
        points
    }

    #[test]
    fn cloth_between_the_legs_moves_with_both() {
        let skirt = Skirt {
            hem: 0.6,
            hips: 1.0,
        };
        let before = thighs();
        let mut after = thighs();
        skirt.hang([&mut after, &mut SurfacePoints::default()]);
        let left = |points: &SurfacePoints, i: usize| -> f32 {
            let own = points.skinning[i].iter();
            own.filter(|(bone, _)| *bone == 1).map(|(_, w)| w).sum()
        };
        for (i, at) in before.points.iter().enumerate() {
            let inside = (0.6..1.0).contains(&at[1]);
            if !inside {
                assert_eq!(after.skinning[i], before.skinning[i], "{at:?}");
            } else if at[0] == 0.0 {
                assert!((left(&after, i) - 0.5).abs() < 0.1, "{}", left(&after, i));
            } else if at[0] > 0.09 {
                assert!(left(&after, i) > 0.75, "{}", left(&after, i));
            }
        }
        let both = [(1, 0.5), (2, 0.5), (0, 0.0), (0, 0.0)];
        let density = |count| Skirt::density(&both, count);
        assert!((density(MANY as usize) - STRETCH).abs() < 1e-9);
        assert!(density(MANY as usize / 10) < 0.25 * STRETCH);
        assert!((Skirt::density(&before.skinning[0], MANY as usize) - 1.0).abs() < 1e-9);
    }
}
