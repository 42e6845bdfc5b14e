//! Grades: what each figure means for training.
//!
//! The bounds come from captures that are known to be right (made-up people and rendered
//! characters, whose body fits by 0.7 and more) and from the same with deliberate errors.

use super::agreement::{Agreement, duplicates};
use super::causes::{Search, search, what};
use super::figure::size;
use super::fit::Fitter;
use super::motion::Motion;
use super::observe::Observation;
use super::plan::spread;
use super::precision;
use super::report::{Cause, Grade, Kind, Measure, Report};
use super::timing::{self, Shifts};
use crate::skeleton::Skeleton;
use yoto_proto::correction::{Correction, Unit, Units};
use yoto_proto::pose_track::PoseTrack;

/// Frames that readings are tried on.
const SAMPLE: usize = 32;
/// Rest joints that span more are in another unit, metres.
const GIANT: f64 = 10.0;
/// Frames named of one fault.
const NAMED: usize = 8;

/// Everything about `track` and the frames that were looked at.
pub(super) fn report(track: &PoseTrack, skeleton: &Skeleton, seen: &[Observation]) -> Report {
    let people: Vec<&Observation> = seen.iter().filter(|it| it.somebody()).collect();
    let agreement = Agreement::of(track, skeleton, seen);
    let motion = Motion::of(track, skeleton);
    let inverted = median(people.iter().map(|it| it.covered)).is_some_and(|it| it > 0.5)
        && agreement.joints_in_mask.is_some_and(|it| it < 0.5);
    let given = Fitter::new(track, spread(&people, SAMPLE)).fit(&Correction::default());
    // Inverted masks fit nothing; the right way round they tell of further mistakes.
    let righted: Vec<Observation>;
    let seen_right = if inverted {
        righted = seen.iter().map(Observation::inverted).collect();
        &righted
    } else {
        seen
    };
    let people: Vec<&Observation> = seen_right.iter().filter(|it| it.somebody()).collect();
    let found = search(&mut Fitter::new(track, spread(&people, SAMPLE)));
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
            options: String::new(),
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
    let late = late(&bodies, &images, &reading);
    let geometry = causes.first().cloned();
    causes.extend(late.clone());

    let explained = causes.first().map(Cause::sentence);
    let fit = found.as_ref().map(|it| it.given.mean);
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
        jumps(track, &motion),
        jitter(&motion),
        wander(precision::scatter(track, &reading, fatness, seen_right)),
        repeats(track, skeleton, seen),
        blur(track, seen),
        exposure(seen),
    ];
    for measure in &mut measures {
        let geometric = matches!(
            measure.kind,
            Kind::JointsInMask | Kind::MaskInBox | Kind::Silhouette | Kind::ImageInMask
        );
        if geometric && measure.grade != Grade::Pass {
            measure.cause = explained.clone().or_else(|| measure.cause.take());
        }
    }
    Report {
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
        tried: found.map(|it| it.tried).unwrap_or_default(),
        mask_shifts: bodies.gains,
    }
}

/// A body of many metres whose picture fits: all its lengths are in another unit, which
/// leaves projections as they are.
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

/// Masks or poses of other frames, and which of the two.
fn late(bodies: &Shifts, images: &Shifts, reading: &Correction) -> Option<Cause> {
    let frames = |n: i32| match n.abs() {
        1 => "1 frame".to_owned(),
        n => format!("{n} frames"),
    };
    let when = |n: i32| if n > 0 { "late" } else { "early" };
    // Images that show their masks at no shift acquit the masks: the poses are off.
    let masks_fit_images = !images.gains.is_empty() && images.best == 0;
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
    // Without a background of black nothing tells which of the two is off.
    let unsure = images.gains.is_empty();
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

fn measure(kind: Kind, grade: Grade, value: Option<f64>, shown: String, meaning: &str) -> Measure {
    Measure {
        kind,
        grade,
        value,
        shown,
        meaning: meaning.to_owned(),
        cause: None,
        frames: Vec::new(),
    }
}

/// Pass from `pass` on, warn from `warn` on.
fn at_least(value: f64, pass: f64, warn: f64) -> Grade {
    if value >= pass {
        Grade::Pass
    } else if value >= warn {
        Grade::Warn
    } else {
        Grade::Fail
    }
}

fn at_most(value: f64, pass: f64, warn: f64) -> Grade {
    at_least(-value, -pass, -warn)
}

fn percent(share: f64) -> String {
    // An empty sum is -0, which would show its sign.
    format!("{:.1} %", 100.0 * share + 0.0)
}

/// A share of which `None` says that nobody was there to measure.
fn share(kind: Kind, value: Option<f64>, bounds: [f64; 2], meaning: &str) -> Measure {
    match value {
        Some(value) => measure(
            kind,
            at_least(value, bounds[0], bounds[1]),
            Some(value),
            percent(value),
            meaning,
        ),
        None => measure(
            kind,
            Grade::Fail,
            None,
            "nobody".to_owned(),
            "no mask that was looked at shows anybody",
        ),
    }
}

fn reading_of(cause: Option<&Cause>) -> Measure {
    let Some(cause) = cause else {
        let meaning = "no other reading of poses and cameras fits the masks decisively better";
        return measure(
            Kind::Reading,
            Grade::Pass,
            Some(0.0),
            "as given".to_owned(),
            meaning,
        );
    };
    let gain = cause.fit_mended - cause.fit;
    let shown = format!("+{:.0} % overlap", 100.0 * gain);
    let meaning = "the numbers mean something else than they should";
    Measure {
        cause: Some(cause.sentence()),
        ..measure(Kind::Reading, Grade::Fail, Some(gain), shown, meaning)
    }
}

fn timing_of(cause: Option<&Cause>, bodies: &Shifts, images: &Shifts) -> Measure {
    let shift = if bodies.best == 0 {
        images.best
    } else {
        bodies.best
    };
    let Some(cause) = cause else {
        let meaning = "masks and poses are of the same frames, as far as outlines tell";
        return measure(
            Kind::Timing,
            Grade::Pass,
            Some(0.0),
            "0 frames".to_owned(),
            meaning,
        );
    };
    let shown = format!("{shift:+} frames");
    let meaning = "outlines of another moment blur moving limbs away";
    Measure {
        cause: Some(cause.sentence()),
        ..measure(
            Kind::Timing,
            Grade::Fail,
            Some(f64::from(shift)),
            shown,
            meaning,
        )
    }
}

fn body_size(span: f64) -> Measure {
    let grade = if (0.6..=2.6).contains(&span) {
        Grade::Pass
    } else if (0.25..=4.0).contains(&span) {
        Grade::Warn
    } else {
        Grade::Fail
    };
    let meaning = "span of the rest joints; margins and priors are in metres";
    let cause = (grade != Grade::Pass).then(|| {
        "rest joints are not in metres, or not of a person in a T-pose (`--units` reads others)"
            .to_owned()
    });
    Measure {
        cause,
        ..measure(
            Kind::BodySize,
            grade,
            Some(span),
            format!("{span:.2} m"),
            meaning,
        )
    }
}

fn joints(agreement: &Agreement) -> Measure {
    let meaning = "joints outside are learnt as empty space";
    let mut it = share(
        Kind::JointsInMask,
        agreement.joints_in_mask,
        [0.9, 0.6],
        meaning,
    );
    if it.grade != Grade::Pass {
        it.cause = Some("poses or cameras are of another person, video or time".to_owned());
        it.frames.clone_from(&agreement.joints_out);
    }
    it
}

fn boxed(agreement: &Agreement) -> Measure {
    let meaning = "what is outside the box gets no rays";
    let mut it = share(Kind::MaskInBox, agreement.mask_in_box, [0.98, 0.9], meaning);
    if it.grade != Grade::Pass {
        it.cause = Some("the mask holds more than the person, or poses are off".to_owned());
        it.frames.clone_from(&agreement.mask_out);
    }
    it
}

fn silhouette(fit: Option<f64>) -> Measure {
    let meaning = "overlap of a rough body around the bones with the mask";
    let mut it = share(Kind::Silhouette, fit, [0.65, 0.45], meaning);
    if it.grade != Grade::Pass {
        it.cause = Some("poses are imprecise, or clothes hide the body".to_owned());
    }
    it
}

fn image_in_mask(agreement: &Agreement) -> Measure {
    let Some(value) = agreement.image_in_mask else {
        let meaning = "images are not over black, so they can't be compared with masks";
        return measure(
            Kind::ImageInMask,
            Grade::Pass,
            None,
            "not over black".to_owned(),
            meaning,
        );
    };
    let meaning = "overlap of what images show with masks; the rest is learnt as haze or holes";
    let mut it = share(Kind::ImageInMask, Some(value), [0.85, 0.6], meaning);
    if it.grade != Grade::Pass {
        it.cause = Some("masks are of other frames, or rough".to_owned());
        it.frames.clone_from(&agreement.image_out);
    }
    it
}

fn masks(track: &PoseTrack, seen: &[Observation], inverted: bool) -> Measure {
    let index = |it: &Observation| track.frames[it.position].index;
    let named = |fits: &dyn Fn(&Observation) -> bool| -> Vec<u32> {
        seen.iter().filter(|it| fits(it)).map(index).collect()
    };
    let empty = named(&|it| !it.somebody());
    let pieces = named(&|it| it.scattered > 0.1);
    let cut = named(&|it| it.somebody() && it.cut_off);
    let share = |frames: &[u32]| frames.len() as f64 / seen.len().max(1) as f64;
    let faults = [
        (&empty, 0.3, "empty", "nobody is in some masks"),
        (
            &pieces,
            0.6,
            "in pieces",
            "some masks fall into pieces: somebody else, or holes",
        ),
        (
            &cut,
            1.1,
            "cut off",
            "the person leaves the image: what is outside is not learnt",
        ),
    ];
    let meaning = "masks show one whole person";
    let mut found = measure(
        Kind::Masks,
        Grade::Pass,
        Some(0.0),
        "whole".to_owned(),
        meaning,
    );
    for (frames, fail, shown, meaning) in faults {
        let value = share(frames);
        let grade = at_most(value, 0.02, fail);
        if grade > found.grade {
            found = measure(
                Kind::Masks,
                grade,
                Some(value),
                format!("{} {shown}", percent(value)),
                meaning,
            );
            found.frames = frames.iter().copied().take(NAMED).collect();
        }
    }
    if inverted {
        let meaning = "masks cover the background";
        found = measure(
            Kind::Masks,
            Grade::Fail,
            Some(1.0),
            "inverted".to_owned(),
            meaning,
        );
        found.cause = Some("write 255 - value into each mask".to_owned());
    }
    found
}

fn views(motion: &Motion) -> Measure {
    let seen = motion.headings.iter().filter(|&&n| n > 0).count();
    let meaning = "sides that no camera saw are guessed";
    let mut it = measure(
        Kind::Views,
        at_least(seen as f64, 10.0, 2.0),
        Some(seen as f64),
        format!("{seen} of 12"),
        meaning,
    );
    if it.grade != Grade::Pass {
        let missing: Vec<String> = (0..12)
            .filter(|&i| motion.headings[i] == 0)
            .map(|i| format!("{}°", 30 * i))
            .collect();
        it.cause = Some(format!(
            "the person does not turn all the way round; missing from the front to the left: {}",
            missing.join(" ")
        ));
    }
    it
}

fn jumps(track: &PoseTrack, motion: &Motion) -> Measure {
    let count = motion.jumps.len();
    let value = count as f64 / track.frames.len().max(1) as f64;
    let meaning = "frames before which a joint jumps as no body can";
    let mut it = measure(
        Kind::Jumps,
        at_most(value, 0.0, 0.05),
        Some(count as f64),
        format!("{count} frames"),
        meaning,
    );
    if count > 0 {
        it.cause = Some("cuts in the film, missing frames, or a tracker that lost hold".to_owned());
        it.frames = motion.jumps.iter().copied().take(NAMED).collect();
    }
    it
}

fn jitter(motion: &Motion) -> Measure {
    let meaning = "how far joints tremble from frame to frame; it blurs what is learnt";
    let Some(value) = motion.jitter else {
        let shown = "too few frames".to_owned();
        return measure(Kind::Jitter, Grade::Pass, None, shown, meaning);
    };
    let mut it = measure(
        Kind::Jitter,
        at_most(value, 0.015, 0.05),
        Some(value),
        format!("{:.1} mm", 1000.0 * value),
        meaning,
    );
    if it.grade != Grade::Pass {
        it.cause = Some("poses were estimated a frame at a time: smooth them".to_owned());
    }
    it
}

fn wander(value: Option<f64>) -> Measure {
    let meaning = "how far bodies wander off their masks; detail smaller than that is lost";
    let Some(value) = value else {
        let shown = "too few frames".to_owned();
        return measure(Kind::Precision, Grade::Pass, None, shown, meaning);
    };
    let mut it = measure(
        Kind::Precision,
        at_most(value, 0.01, 0.1),
        Some(value),
        format!("{:.1} mm", 1000.0 * value),
        meaning,
    );
    if it.grade != Grade::Pass {
        it.cause = Some("poses are noisy, as estimators give them".to_owned());
    }
    it
}

fn repeats(track: &PoseTrack, skeleton: &Skeleton, seen: &[Observation]) -> Measure {
    let (frames, compared) = duplicates(track, skeleton, seen);
    let value = frames.len() as f64 / compared.max(1) as f64;
    let meaning = "frames that repeat the one before although the pose moved";
    let mut it = measure(
        Kind::Duplicates,
        at_most(value, 0.01, 0.3),
        Some(value),
        percent(value),
        meaning,
    );
    if it.grade != Grade::Pass {
        it.cause = Some("the video was brought to a higher frame rate by repeating".to_owned());
        it.frames = frames.into_iter().take(NAMED).collect();
    }
    it
}

fn blur(track: &PoseTrack, seen: &[Observation]) -> Measure {
    let meaning = "width of the person's edges (sigma of a blur); finer detail can't be learnt";
    let Some(value) = median(seen.iter().filter_map(|it| it.blur)) else {
        let shown = "no texture".to_owned();
        return measure(Kind::Blur, Grade::Pass, None, shown, meaning);
    };
    let mut it = measure(
        Kind::Blur,
        at_most(value, 2.0, 5.0),
        Some(value),
        format!("{value:.2} px"),
        meaning,
    );
    if it.grade != Grade::Pass {
        it.cause = Some("out of focus, moved, compressed hard, or enlarged".to_owned());
    }
    let blurred = |o: &&Observation| o.blur.is_some_and(|b| b > 2.0 * value && b > 2.0);
    let frames = seen.iter().filter(blurred);
    it.frames = frames
        .map(|o| track.frames[o.position].index)
        .take(NAMED)
        .collect();
    it
}

fn exposure(seen: &[Observation]) -> Measure {
    let people = || seen.iter().filter(|it| it.somebody());
    let burnt = median(people().map(|it| it.burnt)).unwrap_or(0.0);
    let black = median(people().map(|it| it.black)).unwrap_or(0.0);
    let bright = median(people().map(|it| it.brightness)).unwrap_or(0.0);
    let shown = format!(
        "{} burnt out, {} black, mean {:.2}",
        percent(burnt),
        percent(black),
        bright
    );
    let meaning = "colours at either end are lost";
    let grade = at_most(burnt, 0.05, 0.5).max(at_most(black, 0.3, 0.8));
    let mut it = measure(
        Kind::Exposure,
        grade,
        Some(burnt.max(black)),
        shown,
        meaning,
    );
    if grade != Grade::Pass {
        let cause = if burnt > 0.05 {
            "over-exposed"
        } else {
            "under-exposed, or the images are black under their masks"
        };
        it.cause = Some(cause.to_owned());
    }
    it
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
