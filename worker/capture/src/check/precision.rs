//! How precisely poses follow their frames: how far each frame's body is off its mask, centre
//! from centre, and how far these offsets scatter.
//!
//! A wrong camera or body shape moves all frames alike, while the errors of a pose estimator
//! wander, smooth as they may be.

use super::figure::Figure;
use super::fit::{Fitter, view};
use super::observe::Observation;
use super::plan::spread;
use super::silhouette::{Canvas, Grid, Thumb};
use crate::Shard;
use crate::skeleton::transform::dot;
use crate::skeleton::{Skeleton, SkeletonError};
use yoto_proto::correction::Correction;
use yoto_proto::pose_track::PoseTrack;

/// Frames measured, at most.
const MOST: usize = 100;
/// Frames from which the body's thickness is told, at most.
const SAMPLE: usize = 32;
/// Frames from which a scatter is told, at least.
const ENOUGH: usize = 8;

/// Poses that wander farther than this are imprecise, metres: rendered captures with exact poses
/// have up to 11 mm, with an estimator's noise 20.
pub const PRECISE: f64 = 0.0125;

/// How far the bodies of a capture wander off the masks of its frames, metres in the plane of the
/// image; none with too few frames that show a whole person.
///
/// # Errors
/// Invalid skeleton.
pub fn precision(shard: &Shard) -> Result<Option<f64>, SkeletonError> {
    let track = &shard.track;
    Skeleton::from_track(&track.skeleton)?;
    let places: Vec<usize> = (0..shard.frames()).collect();
    let seen = spread(&places, MOST).into_iter();
    let seen: Vec<Observation> = seen
        .map(|place| Observation::of(place, &shard.image(place)))
        .collect();
    let people: Vec<&Observation> = seen.iter().filter(|it| it.somebody()).collect();
    let reading = Correction::default();
    let fit = Fitter::new(track, spread(&people, SAMPLE)).fit(&reading);
    Ok(fit.and_then(|fit| scatter(track, &reading, fit.fatness, &seen)))
}

/// Root mean square of the offsets about their mean, metres in the plane of the image; none
/// with too few frames. `track` is read as `reading` says.
pub(super) fn scatter(
    track: &PoseTrack,
    reading: &Correction,
    fatness: f64,
    seen: &[Observation],
) -> Option<f64> {
    let track = reading.apply(track).ok()?.track;
    let skeleton = Skeleton::from_track(&track.skeleton).ok()?;
    let figure = Figure::of(&skeleton);
    let grid = Grid::of(track.image_size);
    let mut canvas = Canvas::new(grid);
    // What is beyond the image's border pulls no mask's centre.
    let whole = |it: &&Observation| it.somebody() && !it.cut_off;
    let people: Vec<&Observation> = seen.iter().filter(whole).collect();
    let mut offsets = Vec::new();
    for it in spread(&people, MOST) {
        let (pose, camera) = view(track.frames.get(it.position)?, track.image_size);
        let Some(&root) = skeleton.posed_joints(&pose).first() else {
            continue;
        };
        let [x, y, z, t] = camera.e[2];
        let metres = (dot([x, y, z], root) + t) / (camera.k[0][0] * grid.scale);
        let cells = canvas.draw(&figure.posed(&pose), &camera, fatness);
        if let Some(offset) = offset(cells, &it.mask, grid) {
            offsets.push(offset.map(|cells| cells * metres));
        }
    }
    if offsets.len() < ENOUGH {
        return None;
    }
    let count = offsets.len() as f64;
    let variance = |axis: usize| {
        let mean = offsets.iter().map(|it| it[axis]).sum::<f64>() / count;
        offsets
            .iter()
            .map(|it| (it[axis] - mean).powi(2))
            .sum::<f64>()
            / count
    };
    Some((variance(0) + variance(1)).sqrt())
}

/// From the centre of the drawing to that of the mask, cells across and down; none where
/// nothing is drawn.
fn offset(cells: &[u32], mask: &Thumb, grid: Grid) -> Option<[f64; 2]> {
    let drawn = centre(cells.iter().map(|&cell| (cell as usize, 1.0)), grid)?;
    let covered = mask.cells.iter().enumerate();
    let seen = centre(covered.map(|(cell, &m)| (cell, f64::from(m))), grid)?;
    Some([seen[0] - drawn[0], seen[1] - drawn[1]])
}

/// The centre of weighted cells.
fn centre(cells: impl Iterator<Item = (usize, f64)>, grid: Grid) -> Option<[f64; 2]> {
    let (mut x, mut y, mut total) = (0.0, 0.0, 0.0);
    for (cell, weight) in cells {
        x += weight * (cell % grid.width) as f64;
        y += weight * (cell / grid.width) as f64;
        total += weight;
    }
    (total > 0.0).then(|| [x / total, y / total])
}
