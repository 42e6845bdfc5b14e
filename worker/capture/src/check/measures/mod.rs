//! The measures of a capture, and their grades for training.
//!
//! The bounds come from captures that are known to be right (synthetic people and rendered characters,
//! with an overlap of 0.7 and more) and from the same captures with deliberate errors.

mod frames;
mod geometry;
mod grading;

use super::advice::{Film, advice, lacks};
use super::agreement::Agreement;
use super::causes::{Search, search, what};
use super::figure::size;
use super::fit::Fitter;
use super::framing::Framing;
use super::motion::Motion;
use super::observe::Observation;
use super::plan::spread;
use super::report::{Cause, CheckReport, Grade, MeasureKind};
use super::timing::{self, Shifts};
use super::{gait, precision};
use crate::skeleton::Skeleton;
use frames::{blur, exposure, jitter, jumps, masks, repeats, views, wander};
use geometry::{
    IMAGE_IN_MASK, body_size, boxed, image_in_mask, joints, reading_of, silhouette, timing_of,
};
use grading::median;
use yoto_proto::correction::{Correction, Unit, Units};
use yoto_proto::pose_track::PoseTrack;

/// Readings are tried on at most this number of frames.
const SAMPLE: usize = 32;
/// Largest span of rest joints in metres; a larger one is in another unit.
const GIANT: f64 = 10.0;
/// Frames named per fault, at most.
const NAMED: usize = 8;

/// The report on `track` and the observed frames.
pub(super) fn report(track: &PoseTrack, skeleton: &Skeleton, seen: &[Observation]) -> CheckReport {
    let people: Vec<&Observation> = seen.iter().filter(|it| it.shows_person()).collect();
    let agreement = Agreement::of(track, skeleton, seen);
    let motion = Motion::of(track, skeleton);
    let inverted = median(people.iter().map(|it| it.covered)).is_some_and(|it| it > 0.5)
        && agreement.joints_in_mask.is_some_and(|it| it < 0.5);
    let given = Fitter::new(track, spread(&people, SAMPLE)).fit(&Correction::default());
    // Inverted masks fit nothing. They are turned back first, so that further mistakes are found too.
    let righted: Vec<Observation>;
    let seen_right = if inverted {
        righted = seen.iter().map(Observation::inverted).collect();
        &righted
    } else {
        seen
    };
    let people: Vec<&Observation> = seen_right.iter().filter(|it| it.shows_person()).collect();
    let mut fitter = Fitter::new(track, spread(&people, SAMPLE));
    let mut found = search(&mut fitter);
    if let Some(search) = &mut found {
        gait::mirror(search, &mut fitter, track, seen_right);
    }
    let reading = found
        .as_ref()
        .map_or_else(Correction::default, |it| it.best);
    let fatness = found.as_ref().map_or(1.0, |it| it.best_fit.fatness);
    let bodies = timing::bodies(track, &reading, fatness, seen_right);
    let images = match agreement.image_in_mask {
        Some(_) => timing::images(seen_right),
        None => Shifts::default(),
    };

    let mut causes = Vec::new();
    let span = size(skeleton);
    if inverted {
        let mended = found.as_ref().map_or(0.0, |it| it.given.mean);
        causes.push(Cause {
            what: "masks look inverted: they cover what is not the person".to_owned(),
            options: "--mask-kind inverted".to_owned(),
            correction: None,
            fit: given.map_or(0.0, |it| it.mean),
            fit_mended: mended,
            alternatives: Vec::new(),
        });
    }
    if let Some(cause) = giant(span, found.as_ref()) {
        causes.push(cause);
    } else {
        causes.extend(found.as_ref().and_then(|it| it.cause.clone()));
    }
    let fitting = agreement
        .image_is_mask
        .is_some_and(|it| it >= IMAGE_IN_MASK[0]);
    let late = late(&bodies, &images, fitting, &reading);
    let geometry = causes.first().cloned();
    causes.extend(late.clone());

    let explained = causes.first().map(Cause::sentence);
    let fit = found.as_ref().map(|it| it.given.mean);
    let (blur, exposure) = (blur(track, seen), exposure(seen));
    // With a wrong reading of the numbers, nobody knows what is in the picture.
    let framing = match causes.is_empty() {
        true => Framing::of(track, skeleton),
        false => Framing::default(),
    };
    let lacks = lacks(&Film {
        motion: &motion,
        framing: &framing,
        blur: &blur,
        exposure: &exposure,
    });
    let mut measures = vec![
        reading_of(geometry.as_ref()),
        timing_of(late.as_ref(), &bodies, &images),
        body_size(span),
        joints(&agreement),
        boxed(&agreement),
        silhouette(fit),
        image_in_mask(&agreement),
        masks(track, seen, inverted),
        views(&motion),
        jumps(&motion),
        jitter(&motion),
        wander(precision::wander(track, &reading, fatness, seen_right)),
        repeats(track, skeleton, seen),
        blur,
        exposure,
    ];
    for measure in &mut measures {
        let geometric = matches!(
            measure.kind,
            MeasureKind::JointsInMask
                | MeasureKind::MaskInBox
                | MeasureKind::Silhouette
                | MeasureKind::ImageInMask
        );
        if geometric && measure.grade != Grade::Pass {
            measure.cause = explained.clone().or_else(|| measure.cause.take());
        }
    }
    CheckReport {
        frames: track.frames.len(),
        looked_at: seen.len(),
        grade: measures
            .iter()
            .map(|it| it.grade)
            .max()
            .unwrap_or(Grade::Pass),
        measures,
        causes,
        headings: motion.headings,
        advice: advice(&lacks),
        lacks,
        tried: found.map(|it| it.tried).unwrap_or_default(),
        mask_shifts: bodies.gains,
    }
}

/// The cause for a giant body that fits its masks: all lengths are in another unit, which leaves
/// projections as they are.
fn giant(span: f64, found: Option<&Search>) -> Option<Cause> {
    let search = found.filter(|it| span > GIANT && it.cause.is_none())?;
    let unit = if span > 500.0 {
        Unit::Millimetre
    } else {
        Unit::Centimetre
    };
    let correction = Correction {
        units: Units::all(unit),
        ..Correction::default()
    };
    Some(Cause {
        what: what(&correction),
        options: correction.to_string(),
        correction: Some(correction),
        fit: search.given.mean,
        fit_mended: search.given.mean,
        alternatives: Vec::new(),
    })
}

/// The cause for a shift between masks and poses, and which of the two is late. `fitting` is whether images
/// agree with their masks.
fn late(bodies: &Shifts, images: &Shifts, fitting: bool, reading: &Correction) -> Option<Cause> {
    let frames = |n: i32| match n.abs() {
        1 => "1 frame".to_owned(),
        n => format!("{n} frames"),
    };
    let when = |n: i32| if n > 0 { "late" } else { "early" };
    // If images agree with their masks, and with no shift better, the masks are right and the poses are late.
    let masks_fit_images = fitting && images.best == 0;
    let shift = bodies.best;
    let (correction, what) = if shift == 0 && images.best == 0 {
        return None;
    } else if shift != 0 && masks_fit_images {
        let what = format!("poses come {} {}", frames(shift), when(-shift));
        let correction = Correction {
            pose_shift: -shift,
            ..*reading
        };
        (correction, what)
    } else {
        let shift = if shift == 0 { images.best } else { shift };
        let what = format!("masks come {} {}", frames(shift), when(shift));
        let correction = Correction {
            mask_shift: shift,
            ..*reading
        };
        (correction, what)
    };
    let shifts = if shift == 0 { images } else { bodies };
    let other = Correction {
        mask_shift: -correction.pose_shift,
        pose_shift: -correction.mask_shift,
        ..*reading
    };
    // Without a black background, or if images fit their masks at no shift, it is unknown which of the two
    // is late.
    let unsure = !masks_fit_images && images.best == 0;
    Some(Cause {
        what,
        options: correction.to_string(),
        correction: Some(correction),
        fit: shifts.fit,
        fit_mended: shifts.fit_mended,
        alternatives: if unsure {
            vec![other.to_string()]
        } else {
            Vec::new()
        },
    })
}
