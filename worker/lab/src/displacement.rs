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

/// Points on each person's clothes.
const POINTS: usize = 400;
/// Frames of the unseen motion that are compared.
const POSES: usize = 16;
/// Seed of the points.
const SEED: u64 = 1;

/// Errors of a learned displacement in poses that were not filmed, millimetres, means over points,
/// poses and people.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DisplacementError {
    /// Of the part that changes with the pose.
    pub error_mm: f64,
    /// Length of the true displacement's part that changes with the pose: the error of a field
    /// that never moves.
    pub still_mm: f64,
}

impl DisplacementError {
    /// The mean of several models' errors; `None` without any.
    pub(crate) fn mean(errors: &[Self]) -> Option<Self> {
        let count = errors.len() as f64;
        (count > 0.0).then(|| Self {
            error_mm: errors.iter().map(|it| it.error_mm).sum::<f64>() / count,
            still_mm: errors.iter().map(|it| it.still_mm).sum::<f64>() / count,
        })
    }
}

/// The error over `people`, each a slot of the model and a recording; `None` where no recording
/// has known clothes.
pub(crate) fn measure(
    renderer: &Renderer,
    people: &[(usize, &Recording)],
) -> anyhow::Result<Option<DisplacementError>> {
    let (mut error, mut still, mut count) = (0.0, 0.0, 0usize);
    for (slot, recording) in people {
        let Some(actor) = &recording.actor else {
            continue;
        };
        let poses: Vec<Pose> = actor.unseen_motion(POSES);
        // A point counts when its true offset is known in every pose.
        let known = |point: &[f64; 3]| -> Option<([f32; 3], Vec<[f64; 3]>)> {
            let offsets = poses.iter().map(|pose| actor.offset(pose, *point));
            Some((point.map(|v| v as f32), offsets.collect::<Option<_>>()?))
        };
        let points = actor.cloth_points(POINTS, SEED);
        let (points, truth): (Vec<_>, Vec<_>) = points.iter().filter_map(known).unzip();
        let mut learned = vec![Vec::with_capacity(poses.len()); points.len()];
        for pose in &poses {
            let offsets = renderer
                .displacements(*slot, pose, &points)
                .with_context(|| format!("the displacement of {}", recording.name))?;
            for (point, offset) in learned.iter_mut().zip(offsets) {
                point.push(offset.map(f64::from));
            }
        }
        for (truth, learned) in truth.iter().zip(&learned) {
            let (truth, learned) = (centred(truth), centred(learned));
            for (t, l) in truth.iter().zip(&learned) {
                error += length(std::array::from_fn(|a| t[a] - l[a]));
                still += length(*t);
                count += 1;
            }
        }
    }
    Ok((count > 0).then(|| DisplacementError {
        error_mm: 1e3 * error / count as f64,
        still_mm: 1e3 * still / count as f64,
    }))
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
