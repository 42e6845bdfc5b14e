//! Finds masks or poses that are some frames late.

use super::figure::CapsuleBody;
use super::fit::{mean_and_error, view};
use super::observe::Observation;
use super::silhouette::{Canvas, Grid};
use crate::skeleton::Skeleton;
use std::collections::HashMap;
use yoto_proto::correction::Correction;
use yoto_proto::pose_track::PoseTrack;

/// Largest shift tried, frames either way.
const MOST: i32 = 12;
/// Least gain of a shift that is named, in overlap and in standard errors.
const GAIN: f64 = 0.002;
const ERRORS: f64 = 4.0;
/// Fewest frames for the gain of a shift.
const ENOUGH: usize = 8;

/// Gain in overlap for each shift of the masks.
#[derive(Clone, Debug, Default)]
pub(super) struct Shifts {
    /// Each shift in frames with its mean gain over no shift.
    pub gains: Vec<(i32, f64)>,
    /// The shift that is decisively better than none, or 0.
    pub best: i32,
    /// Mean overlap without a shift.
    pub fit: f64,
    /// Mean overlap with the best shift.
    pub fit_mended: f64,
}

/// The overlap of projected bodies with the masks of earlier and later frames.
pub(super) fn bodies(
    track: &PoseTrack,
    reading: &Correction,
    fatness: f64,
    seen: &[Observation],
) -> Shifts {
    let Ok(corrected) = reading.apply(track) else {
        return Shifts::default();
    };
    let track = corrected.track;
    let Ok(skeleton) = Skeleton::from_track(&track.skeleton) else {
        return Shifts::default();
    };
    let figure = CapsuleBody::of(&skeleton);
    let mut canvas = Canvas::new(Grid::of(track.image_size));
    compare(seen, |own, others| {
        let (pose, camera) = view(&track.frames[own.position], track.image_size);
        let cells = canvas.draw(&figure.posed(&pose), &camera, fatness);
        others.iter().map(|it| it.mask.overlap(cells)).collect()
    })
}

/// The overlap of image content with the masks of earlier and later frames.
pub(super) fn images(seen: &[Observation]) -> Shifts {
    compare(seen, |own, others| {
        let overlap = |it: &&Observation| it.mask.overlap_with(&own.content);
        others.iter().map(overlap).collect()
    })
}

/// Collects, for each shift, the gain in overlap over no shift.
fn compare(
    seen: &[Observation],
    mut overlaps: impl FnMut(&Observation, &[&Observation]) -> Vec<f64>,
) -> Shifts {
    let by_position: HashMap<i64, &Observation> = seen
        .iter()
        .filter(|it| it.shows_person())
        .map(|it| (it.position as i64, it))
        .collect();
    let mut gains: HashMap<i32, Vec<f64>> = HashMap::new();
    let mut fits: HashMap<i32, Vec<f64>> = HashMap::new();
    for own in seen.iter().filter(|it| it.shows_person()) {
        let shifted = |shift: i32| by_position.get(&(own.position as i64 + i64::from(shift)));
        let near: Vec<(i32, &Observation)> = std::iter::once(0)
            .chain((-MOST..=MOST).filter(|&shift| shift != 0))
            .filter_map(|shift| Some((shift, *shifted(shift)?)))
            .collect();
        let others: Vec<&Observation> = near.iter().map(|(_, it)| *it).collect();
        let found = overlaps(own, &others);
        let Some(&unshifted) = found.first() else {
            continue;
        };
        for ((shift, _), overlap) in near.iter().zip(found) {
            gains.entry(*shift).or_default().push(overlap - unshifted);
            fits.entry(*shift).or_default().push(overlap);
        }
    }
    let mut shifts = Shifts::default();
    let mut highest = 0.0;
    for shift in -MOST..=MOST {
        let Some(values) = gains.get(&shift).filter(|it| it.len() >= ENOUGH) else {
            continue;
        };
        let (gain, error) = mean_and_error(values);
        shifts.gains.push((shift, gain));
        if gain > highest && gain >= GAIN.max(ERRORS * error) {
            (highest, shifts.best) = (gain, shift);
        }
    }
    let fit = |shift: i32| fits.get(&shift).map_or(0.0, |it| mean_and_error(it).0);
    (shifts.fit, shifts.fit_mended) = (fit(0), fit(0) + highest);
    shifts
}
