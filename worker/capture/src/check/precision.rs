//! The precision of poses: the deviation of each frame's body from its mask, in position
//! and lean, and its scatter beyond what this person's shape explains.
//!
//! A wrong camera moves all frames in the same way, and clothes and hair by a rule. The errors of a pose
//! estimator wander from frame to frame, even where they are smooth.

use super::fit::Fitter;
use super::observe::Observation;
use super::plan::spread;
use super::shape::Comparison;
use crate::Shard;
use crate::skeleton::{Skeleton, SkeletonError};
use yoto_proto::correction::Correction;
use yoto_proto::pose_track::PoseTrack;

/// Frames measured, at most.
const MOST: usize = 100;
/// The body's thickness is fitted to at most this number of frames.
const SAMPLE: usize = 32;
/// The scatter is measured with at least this number of frames.
const ENOUGH: usize = 12;

/// Poses that wander farther than this are imprecise, metres. `docs/research/check-rates.md` has the rates of false
/// alarms and of misses.
pub const PRECISE: f64 = 0.008;

/// Poses that wander farther than this are wrong rather than noisy, metres: the noise of an estimator (4 degrees per joint and 1 cm) gives
/// 20 mm at most (`docs/research/check-rates.md`).
pub(super) const NOISE: f64 = 0.025;

/// Scatter of a capture's bodies around their masks beyond what the person's shape explains, metres in the
/// plane of the image; `None` with too few frames that show a whole person.
///
/// # Errors
/// Invalid skeleton.
pub fn precision(shard: &Shard) -> Result<Option<f64>, SkeletonError> {
    let track = &shard.track;
    Skeleton::from_track(&track.skeleton)?;
    let positions: Vec<usize> = (0..shard.frames()).collect();
    let seen = spread(&positions, MOST).into_iter();
    let seen: Vec<Observation> = seen
        .map(|position| Observation::of(position, &shard.image(position)))
        .collect();
    let people: Vec<&Observation> = seen.iter().filter(|it| it.shows_person()).collect();
    let reading = Correction::default();
    let fit = Fitter::new(track, spread(&people, SAMPLE)).fit(&reading);
    Ok(fit.and_then(|fit| wander(track, &reading, fit.fatness, &seen)))
}

/// The larger of the scatters of position and lean, metres in the plane of the image; `None` with too few
/// frames. `track` is read with `reading`.
pub(super) fn wander(
    track: &PoseTrack,
    reading: &Correction,
    fatness: f64,
    seen: &[Observation],
) -> Option<f64> {
    let track = reading.apply(track).ok()?.track;
    let skeleton = Skeleton::from_track(&track.skeleton).ok()?;
    // A mask that the image's border cuts off has its centre in the wrong position.
    let whole = |it: &&Observation| it.shows_person() && !it.cut_off;
    let people: Vec<&Observation> = seen.iter().filter(whole).collect();
    if people.len() < ENOUGH {
        return None;
    }
    let mut comparison = Comparison::new(&track, &skeleton, fatness);
    let [position, lean] = comparison.wander(&spread(&people, MOST))?;
    Some(position.max(lean))
}
