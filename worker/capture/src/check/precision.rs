//! How precisely poses follow their frames: how far each frame's body is off its mask, in place and in
//! lean, and how far that scatters beyond what the shape of this person explains.
//!
//! A wrong camera moves all frames alike, and clothes and hair by a rule, while the errors of a pose
//! estimator wander, smooth as they may be.

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
/// Frames from which the body's thickness is told, at most.
const SAMPLE: usize = 32;
/// Frames from which a scatter is told, at least.
const ENOUGH: usize = 12;

/// Poses that wander farther than this are imprecise, metres. `docs/check.md` has the rates of false
/// alarms and of misses.
pub const PRECISE: f64 = 0.0075;

/// How far the bodies of a capture wander off the masks of its frames, beyond what the person's shape
/// explains, metres in the plane of the image; none with too few frames that show a whole person.
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
    Ok(fit.and_then(|fit| wander(track, &reading, fit.fatness, &seen)))
}

/// The larger of how far bodies wander in place, and their ends in lean; metres in the plane of the
/// image, none with too few frames. `track` is read as `reading` says.
pub(super) fn wander(
    track: &PoseTrack,
    reading: &Correction,
    fatness: f64,
    seen: &[Observation],
) -> Option<f64> {
    let track = reading.apply(track).ok()?.track;
    let skeleton = Skeleton::from_track(&track.skeleton).ok()?;
    // What is beyond the image's border pulls no mask's centre.
    let whole = |it: &&Observation| it.somebody() && !it.cut_off;
    let people: Vec<&Observation> = seen.iter().filter(whole).collect();
    if people.len() < ENOUGH {
        return None;
    }
    let mut comparison = Comparison::new(&track, &skeleton, fatness);
    let [place, lean] = comparison.wander(&spread(&people, MOST))?;
    Some(place.max(lean))
}
