//! Left and right, from the change of outlines over time.
//!
//! Bodies are nearly symmetric, so under wide clothes the outline of one frame hardly tells left from
//! right. Steps, swings of the arms and turns do: on the wrong side, bodies wander off their masks in a
//! rhythm that no shape of the body explains.

use super::causes::{Search, what};
use super::fit::{Fit, Fitter};
use super::observe::Observation;
use super::precision::{NOISE, wander};
use super::report::Cause;
use yoto_proto::correction::{Correction, Mirror};
use yoto_proto::pose_track::PoseTrack;

/// The most common mistake first: of readings that wander equally, the first is named.
const MIRRORS: [Mirror; 4] = [Mirror::Poses, Mirror::Images, Mirror::Limbs, Mirror::Labels];
/// Greatest ratio of the wander of the right reading to that of its mirror image.
const SHARE: f64 = 0.75;
/// The same where the wander is more than noise.
const DECISIVE: f64 = 0.5;
/// Greatest ratio of a reading's wander to the least, for a reading that counts as equally good.
const AS_GOOD: f64 = 1.1;

/// Mirrors the reading of `search` if bodies then wander decisively less. Only for numbers that no other
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
    // Where no noise explains the wander, a reading that halves it needs no better outlines: those of wide or dark clothes tell little.
    let is_certain = given > NOISE && least < DECISIVE * given;
    let is_better = |it: &Fit| is_certain || it.mean > search.given.mean;
    let Some(fit) = fitter.fit(first).filter(is_better) else {
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

#[cfg(test)]
mod tests {
    use super::super::{causes, fit, plan};
    use super::*;
    use yoto_proto::correction::{Correction, Mirror};
    use yoto_proto::pose_track::PoseTrack;
    use yoto_synthetic::SyntheticPerson;

    /// A film by a camera to the front and left, where left and right differ in every frame.
    fn film() -> (PoseTrack, Vec<crate::FrameImage>) {
        const SIZE: u32 = 96;
        let person = &SyntheticPerson::cast(1, 5)[0];
        let camera = &SyntheticPerson::held_out_cameras(SIZE)[0];
        let poses = person.motion(60);
        // The crate of synthetic people was compiled with another copy of this crate's types.
        let images = poses.iter().map(|pose| {
            let image = person.render(pose, camera);
            crate::FrameImage {
                width: image.width,
                height: image.height,
                rgb: image.rgb,
                mask: image.mask,
            }
        });
        let track = PoseTrack {
            skeleton: person.skeleton(),
            image_size: [SIZE; 2],
            distortion: [0.0; 5],
            fps: 15.0,
            frames: (0..)
                .zip(&poses)
                .map(|(index, pose)| camera.to_frame(index, pose))
                .collect(),
        };
        (track, images.collect())
    }

    #[test]
    fn sides_are_told_by_how_outlines_move() {
        let (track, images) = film();
        let mut wanders = Vec::new();
        let mirror = |mirror| Correction {
            mirror,
            ..Correction::default()
        };
        for (mistake, options) in [
            (Mirror::None, None),
            (Mirror::Poses, Some("--mirror poses")),
            (Mirror::Limbs, Some("--mirror limbs")),
        ] {
            let read = mirror(mistake).apply(&track).expect("applies").track;
            let looked = images.iter().enumerate();
            let seen: Vec<_> = looked.map(|(i, it)| Observation::of(i, it)).collect();
            let people = plan::spread(&seen.iter().collect::<Vec<_>>(), 12);
            let mut fitter = fit::Fitter::new(&read, people);
            let given = fitter.fit(&Correction::default()).expect("a fit");
            // As if single outlines were inconclusive.
            let mut search = causes::Search {
                best: Correction::default(),
                best_fit: given.clone(),
                given,
                cause: None,
                tried: Vec::new(),
            };
            super::mirror(&mut search, &mut fitter, &read, &seen);
            let found = search.cause.as_ref().map(|it| it.options.as_str());
            assert_eq!(found, options);
            assert_eq!(search.best, mirror(mistake));
            // Outlines that are for the numbers as given count only where the wander can be noise.
            let none = Correction::default();
            let given = wander(&read, &none, search.given.fatness, &seen).expect("a wander");
            search.given.mean = 1.0;
            search.cause = None;
            super::mirror(&mut search, &mut fitter, &read, &seen);
            let found = search.cause.as_ref().map(|it| it.options.as_str());
            assert_eq!(found, options.filter(|_| given > NOISE), "{given}");
            wanders.push(given);
        }
        assert!(wanders.iter().any(|it| *it > NOISE), "{wanders:?}");
    }
}
