//! Left and right, told by how outlines change over time.
//!
//! Bodies are nearly as wide on the left as on the right, so that the outline of one frame hardly tells
//! them apart under wide clothes. Steps, swings of the arms and turns do: with the wrong side, bodies
//! wander off their masks in a rhythm that no shape of the body explains.

use super::causes::{Search, what};
use super::fit::Fitter;
use super::observe::Observation;
use super::precision::wander;
use super::report::Cause;
use yoto_proto::correction::{Correction, Mirror};
use yoto_proto::pose_track::PoseTrack;

/// In order of how common they are: of readings that wander alike the first is named.
const MIRRORS: [Mirror; 4] = [Mirror::Poses, Mirror::Images, Mirror::Limbs, Mirror::Labels];
/// Bodies read the right way wander by less than this share of how far they do mirrored.
const SHARE: f64 = 0.75;
/// Readings that wander by so much more than the least are as good.
const AS_GOOD: f64 = 1.1;

/// Reads `search` mirrored where bodies wander decisively less that way. Only for numbers that no other
/// reading explains.
pub(super) fn mirror(
    search: &mut Search,
    fitter: &mut Fitter<'_>,
    track: &PoseTrack,
    seen: &[Observation],
) {
    if search.cause.is_some() {
        return;
    }
    let none = Correction::default();
    let off = |correction: &Correction| wander(track, correction, search.given.fatness, seen);
    let Some(given) = off(&none) else { return };
    let readings = MIRRORS.map(|mirror| Correction { mirror, ..none });
    let wanders = readings.map(|correction| off(&correction).unwrap_or(f64::INFINITY));
    let least = wanders.into_iter().fold(f64::INFINITY, f64::min);
    if least >= SHARE * given {
        return;
    }
    let as_good: Vec<Correction> = (readings.into_iter().zip(wanders))
        .filter(|(_, wander)| *wander <= AS_GOOD * least)
        .map(|(correction, _)| correction)
        .collect();
    let Some((first, others)) = as_good.split_first() else {
        return;
    };
    let Some(fit) = fitter.fit(first).filter(|it| it.mean > search.given.mean) else {
        return;
    };
    search.cause = Some(Cause {
        what: what(first),
        options: first.to_string(),
        correction: Some(*first),
        fit: search.given.mean,
        fit_mended: fit.mean,
        alternatives: others.iter().map(ToString::to_string).collect(),
    });
    search.best = *first;
    search.best_fit = fit;
}
