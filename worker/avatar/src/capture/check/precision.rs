//! How precisely poses follow their frames: the offset at which each frame's body covers its
//! mask best, and how far these offsets scatter.
//!
//! A wrong camera or body shape moves all frames alike, while the errors of a pose estimator
//! wander, smooth as they may be.

use super::figure::Figure;
use super::fit::view;
use super::observe::Observation;
use super::plan::spread;
use super::silhouette::{Canvas, Grid, Thumb};
use crate::skeleton::Skeleton;
use crate::skeleton::transform::dot;
use yoto_proto::correction::Correction;
use yoto_proto::pose_track::PoseTrack;

/// Frames measured, at most.
const MOST: usize = 100;
/// Frames from which a scatter is told, at least.
const ENOUGH: usize = 8;
/// Offsets tried, cells either way.
const REACH: i32 = 4;

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
    let people: Vec<&Observation> = seen.iter().filter(|it| it.somebody()).collect();
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

/// By how many cells, across and down, the drawing has to move to cover the mask best, to a
/// fraction of a cell; none where even that covers nothing.
fn offset(cells: &[u32], mask: &Thumb, grid: Grid) -> Option<[f64; 2]> {
    let covered = |across: i32, down: i32| -> f64 {
        let sum: u64 = cells
            .iter()
            .map(|&cell| {
                let x = (cell as usize % grid.width) as i64 + i64::from(across);
                let y = (cell as usize / grid.width) as i64 + i64::from(down);
                let inside =
                    (0..grid.width as i64).contains(&x) && (0..grid.height as i64).contains(&y);
                let at = (y * grid.width as i64 + x) as usize;
                if inside { u64::from(mask.cells[at]) } else { 0 }
            })
            .sum();
        sum as f64
    };
    let mut best = (0.0, 0, 0);
    for down in -REACH..=REACH {
        for across in -REACH..=REACH {
            let sum = covered(across, down);
            if sum > best.0 {
                best = (sum, across, down);
            }
        }
    }
    let (top, across, down) = best;
    if top <= 0.0 {
        return None;
    }
    // The peak of the parabola through the best and its neighbours.
    let peak = |before: f64, after: f64| {
        let bend = 2.0 * top - before - after;
        if bend > 0.0 {
            ((after - before) / (2.0 * bend)).clamp(-0.5, 0.5)
        } else {
            0.0
        }
    };
    Some([
        f64::from(across) + peak(covered(across - 1, down), covered(across + 1, down)),
        f64::from(down) + peak(covered(across, down - 1), covered(across, down + 1)),
    ])
}
