//! The error of a model's learned motion of synthetic clothes, against the true motion.
//!
//! A model with a field takes a point that it observes back to the rest pose, by inverse skinning and then
//! by the non-rigid field; the truth is known. A splat is a material point: the truth takes it back to the rest pose from where
//! the model puts it. Both parts are measured together, for skinning
//! weights that the model learns can carry a part of what cloth does. An error that is the same in
//! every pose shows in no picture, since the canonical shape has the opposite error; so each point's
//! mean error over the poses is subtracted. The errors of the model's skinning alone, and of true
//! skinning under clothes that never move, are measured for comparison.

use crate::captures::Recording;
use anyhow::Context;
use serde::{Deserialize, Serialize};
use yoto_avatar::render::{Renderer, TrackedSplats};
use yoto_capture::camera::Pose;
use yoto_synthetic::SyntheticPerson;

/// Points on each person's clothes.
const POINTS: usize = 400;
/// Poses of each motion that are compared.
const POSES: usize = 16;
/// About as many splats of each person are followed.
const SPLATS: usize = 4000;
/// Largest distance of a splat on the clothes from their surface, metres.
const ON_CLOTH: f64 = 0.02;
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

/// The error in some poses, millimetres: of what changes with the pose.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseError {
    /// Error of the model.
    pub error_mm: f64,
    /// Error of the model's skinning, without the non-rigid field and pose blend shapes.
    pub skinned_mm: f64,
    /// Error of true skinning of clothes that never move.
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
                skinned_mm: sum(|it| it.skinned_mm) / count,
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
    let mut sums = [0.0; 3];
    let mut count = 0usize;
    for (slot, actor) in people {
        if let Some((errors, of)) = of_splats(renderer, *slot, actor, &poses(actor))? {
            (0..3).for_each(|i| sums[i] += errors[i]);
            count += of;
            continue;
        }
        let points = actor.cloth_points(POINTS, SEED);
        // Of each point, the errors in every pose: the model's, its skinning's, true skinning's.
        let mut errors: Vec<[Vec<[f64; 3]>; 3]> = vec![Default::default(); points.len()];
        for pose in poses(actor) {
            let truth = |point: &[f64; 3]| {
                let carried = actor.carried(&pose, *point)?;
                Some((carried, actor.observed(&pose, *point)?))
            };
            let truth: Vec<_> = points
                .iter()
                .map(truth)
                .collect::<Option<_>>()
                .context("a point of the clothes is not on them")?;
            let seen: Vec<[f32; 3]> = truth.iter().map(|(_, at)| at.map(|v| v as f32)).collect();
            let rest = renderer
                .rest_points(*slot, &pose, &seen)
                .with_context(|| format!("the clothes of {}", actor.name()))?;
            for (i, errors) in errors.iter_mut().enumerate() {
                let points_at_rest = [
                    rest.moved[i].map(f64::from),
                    rest.skinned[i].map(f64::from),
                    truth[i].0,
                ];
                for (errors, point) in errors.iter_mut().zip(points_at_rest) {
                    errors.push(std::array::from_fn(|a| point[a] - points[i][a]));
                }
            }
        }
        for errors in &errors {
            for (sum, errors) in sums.iter_mut().zip(errors) {
                *sum += centred(errors).into_iter().map(length).sum::<f64>();
            }
            count += errors[0].len();
        }
    }
    let [error_mm, skinned_mm, still_mm] = sums.map(|sum| 1e3 * sum / count.max(1) as f64);
    Ok(PoseError {
        error_mm,
        skinned_mm,
        still_mm,
    })
}

/// Sums of the errors of a model's splats on the clothes in all poses, metres, as in [`PoseError`], and their number; `None`
/// if the model has a field.
fn of_splats(
    renderer: &Renderer,
    slot: usize,
    actor: &SyntheticPerson,
    poses: &[Pose],
) -> anyhow::Result<Option<([f64; 3], usize)>> {
    let follow = |poses: &[Pose]| -> anyhow::Result<Option<Vec<TrackedSplats>>> {
        let each = poses.iter().map(|pose| renderer.track_splats(slot, pose));
        let each: Result<_, _> = each.collect();
        each.with_context(|| format!("the splats of {}", actor.name()))
    };
    let filmed = actor.motion(POSES);
    let (Some(in_film), Some(in_poses)) = (follow(&filmed)?, follow(poses)?) else {
        return Ok(None);
    };
    let total = in_film.first().map_or(0, |it| it.moved.len());
    let (mut sums, mut count) = ([0.0; 3], 0);
    for splat in (0..total).step_by((total / SPLATS).max(1)) {
        let Some((part, rest)) = part_of(actor, &filmed, &in_film, splat) else {
            continue;
        };
        // Of each kind of error, the places at rest in all poses.
        let mut places: [Vec<[f64; 3]>; 3] = Default::default();
        for (pose, at) in poses.iter().zip(&in_poses) {
            let at_rest = |point: [f32; 3]| actor.traced(pose, part, point.map(f64::from));
            places[0].push(at_rest(at.moved[splat]));
            places[1].push(at_rest(at.skinned[splat]));
            places[2].push(actor.still(pose, part, rest));
        }
        for (sum, places) in sums.iter_mut().zip(&places) {
            *sum += centred(places).into_iter().map(length).sum::<f64>();
        }
        count += poses.len();
    }
    Ok(Some((sums, count)))
}

/// The part of the clothes that a `splat` is on, by its mean place at rest in the filmed poses, and that place.
fn part_of(
    actor: &SyntheticPerson,
    filmed: &[Pose],
    in_film: &[TrackedSplats],
    splat: usize,
) -> Option<(usize, [f64; 3])> {
    let parts = (0..actor.cloth_parts()).map(|part| {
        let mut mean = [0.0; 3];
        for (pose, at) in filmed.iter().zip(in_film) {
            let rest = actor.traced(pose, part, at.moved[splat].map(f64::from));
            (0..3).for_each(|a| mean[a] += rest[a] / filmed.len() as f64);
        }
        (part, mean, actor.cloth_distance(part, mean).abs())
    });
    let nearest = parts.min_by(|a, b| a.2.total_cmp(&b.2))?;
    (nearest.2 < ON_CLOTH).then_some((nearest.0, nearest.1))
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
