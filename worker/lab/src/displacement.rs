//! How near a learned non-rigid field comes to the true motion of synthetic clothes.
//!
//! A field may be off by what is the same in every pose, for then the canonical shape is off by
//! the opposite and nothing shows. So the error is told with each point's mean over the poses
//! taken out of both offsets, and beside it what a field that never moves would have.

use crate::captures::Recording;
use anyhow::Context;
use serde::{Deserialize, Serialize};
use yoto_avatar::render::Renderer;
use yoto_capture::camera::Pose;
use yoto_capture::synthetic::SyntheticPerson;

/// Points on each person's clothes.
const POINTS: usize = 400;
/// Poses of each motion that are compared.
const POSES: usize = 16;
/// Seed of the points.
const SEED: u64 = 1;

/// Errors of a learned displacement, millimetres, means over points of the clothes, poses and
/// people.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DisplacementError {
    /// In poses that were filmed.
    pub filmed: PoseError,
    /// In poses that were not.
    pub unseen: PoseError,
}

/// The error in some poses, millimetres.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseError {
    /// Of the part that changes with the pose.
    pub error_mm: f64,
    /// Length of the true displacement's part that changes with the pose: the error of a field
    /// that never moves.
    pub still_mm: f64,
}

impl DisplacementError {
    /// The mean of several models' errors; `None` without any.
    pub(crate) fn mean(errors: &[Self]) -> Option<Self> {
        let mean = |pick: fn(&Self) -> PoseError| {
            let count = errors.len() as f64;
            let sum = |value: fn(&PoseError) -> f64| {
                errors.iter().map(|it| value(&pick(it))).sum::<f64>()
            };
            PoseError {
                error_mm: sum(|it| it.error_mm) / count,
                still_mm: sum(|it| it.still_mm) / count,
            }
        };
        (!errors.is_empty()).then(|| Self {
            filmed: mean(|it| it.filmed),
            unseen: mean(|it| it.unseen),
        })
    }
}

/// The error over `people`, each a slot of the model and a recording; `None` where no recording
/// has known clothes.
pub(crate) fn measure(
    renderer: &Renderer,
    people: &[(usize, &Recording)],
) -> anyhow::Result<Option<DisplacementError>> {
    let known: Vec<_> = people
        .iter()
        .filter_map(|(slot, recording)| Some((*slot, recording.actor.as_ref()?)))
        .collect();
    if known.is_empty() {
        return Ok(None);
    }
    Ok(Some(DisplacementError {
        filmed: over(renderer, &known, |actor| actor.motion(POSES))?,
        unseen: over(renderer, &known, |actor| actor.unseen_motion(POSES))?,
    }))
}

fn over(
    renderer: &Renderer,
    people: &[(usize, &SyntheticPerson)],
    poses: fn(&SyntheticPerson) -> Vec<Pose>,
) -> anyhow::Result<PoseError> {
    let (mut error, mut still, mut count) = (0.0, 0.0, 0usize);
    for (slot, actor) in people {
        let points = actor.cloth_points(POINTS, SEED);
        let mut pairs = vec![(Vec::new(), Vec::new()); points.len()];
        for pose in poses(actor) {
            let carried = points.iter().map(|point| actor.carried(&pose, *point));
            let carried: Vec<[f64; 3]> = carried
                .collect::<Option<_>>()
                .context("a point of the clothes is not on them")?;
            let asked: Vec<[f32; 3]> = carried.iter().map(|c| c.map(|v| v as f32)).collect();
            let learned = renderer
                .displacements(*slot, &pose, &asked)
                .with_context(|| format!("the displacement of {}", actor.name()))?;
            let places = points.iter().zip(&carried).zip(learned);
            for ((truth, found), ((point, carried), learned)) in pairs.iter_mut().zip(places) {
                truth.push(std::array::from_fn(|a| point[a] - carried[a]));
                found.push(learned.map(f64::from));
            }
        }
        for (truth, found) in &pairs {
            for (t, l) in centred(truth).iter().zip(centred(found)) {
                error += length(std::array::from_fn(|a| t[a] - l[a]));
                still += length(*t);
                count += 1;
            }
        }
    }
    Ok(PoseError {
        error_mm: 1e3 * error / count.max(1) as f64,
        still_mm: 1e3 * still / count.max(1) as f64,
    })
}

/// The offsets less their mean.
fn centred(offsets: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let mean: [f64; 3] = std::array::from_fn(|a| {
        offsets.iter().map(|offset| offset[a]).sum::<f64>() / offsets.len().max(1) as f64
    });
    let less = |offset: &[f64; 3]| std::array::from_fn(|a| offset[a] - mean[a]);
    offsets.iter().map(less).collect()
}

fn length(v: [f64; 3]) -> f64 {
    v.iter().map(|c| c * c).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_the_same_in_every_pose_does_not_count() {
        let offsets = [[1.0, 2.0, 3.0], [3.0, 2.0, 1.0]];
        assert_eq!(centred(&offsets), [[-1.0, 0.0, 1.0], [1.0, 0.0, -1.0]]);
        assert_eq!(length([3.0, 0.0, 4.0]), 5.0);
    }
}
