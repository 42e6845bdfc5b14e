//! Measures of the frames themselves: masks, views, motion, blur and exposure.

use super::super::agreement::duplicates;
use super::super::motion::Motion;
use super::super::observe::Observation;
use super::super::precision::{NOISE, PRECISE};
use super::super::report::{Grade, Measure, MeasureKind};
use super::NAMED;
use super::grading::{at_least, at_most, measure, median, percent};
use crate::skeleton::Skeleton;
use yoto_proto::pose_track::PoseTrack;

pub(super) fn masks(track: &PoseTrack, seen: &[Observation], inverted: bool) -> Measure {
    let index = |it: &Observation| track.frames[it.position].index;
    let named = |fits: &dyn Fn(&Observation) -> bool| -> Vec<u32> {
        seen.iter().filter(|it| fits(it)).map(index).collect()
    };
    let empty = named(&|it| !it.shows_person());
    let pieces = named(&|it| it.scattered > 0.1);
    let cut = named(&|it| it.shows_person() && it.cut_off);
    let share = |frames: &[u32]| frames.len() as f64 / seen.len().max(1) as f64;
    let faults = [
        // A frame without anybody in its mask teaches that nobody is there, so that a single one is named.
        (&empty, [0.0, 0.3], "empty", "nobody is in some masks"),
        (
            &pieces,
            [0.02, 0.6],
            "in pieces",
            "some masks are in several pieces: another person, or holes",
        ),
        (
            &cut,
            [0.02, 1.1],
            "cut off",
            "the person leaves the image: what is outside is not learnt",
        ),
    ];
    let meaning = "masks show one whole person";
    let mut found = measure(
        MeasureKind::Masks,
        Grade::Pass,
        Some(0.0),
        "whole".to_owned(),
        meaning,
    );
    for (frames, [pass, fail], shown, meaning) in faults {
        let value = share(frames);
        let grade = at_most(value, pass, fail);
        if grade > found.grade {
            found = measure(
                MeasureKind::Masks,
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
            MeasureKind::Masks,
            Grade::Fail,
            Some(1.0),
            "inverted".to_owned(),
            meaning,
        );
        found.cause = Some("try `--mask-kind inverted`".to_owned());
    }
    found
}

pub(super) fn views(motion: &Motion) -> Measure {
    let seen = motion.headings.iter().filter(|&&n| n > 0).count();
    let meaning = "sides that no camera saw are guessed";
    let mut it = measure(
        MeasureKind::Views,
        at_least(seen as f64, 10.0, 1.0),
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

/// A film with this number of jumps per second fails.
const JUMPS: f64 = 0.75;

pub(super) fn jumps(motion: &Motion) -> Measure {
    let count = motion.jumps.len();
    let a_second = count as f64 / motion.seconds.max(1e-9);
    let meaning = "frames before which a joint jumps as no body can";
    let mut it = measure(
        MeasureKind::Jumps,
        at_most(a_second, 0.0, JUMPS),
        Some(count as f64),
        format!("{count} in {:.1} s", motion.seconds),
        meaning,
    );
    if count > 0 {
        it.cause = Some("cuts in the film, missing frames, or a tracker that lost hold".to_owned());
        it.frames = motion.jumps.iter().copied().take(NAMED).collect();
    }
    it
}

pub(super) fn jitter(motion: &Motion) -> Measure {
    let meaning = "how far joints tremble from frame to frame; it blurs what is learnt";
    let Some(value) = motion.jitter else {
        let shown = "too few frames".to_owned();
        return measure(MeasureKind::Jitter, Grade::Pass, None, shown, meaning);
    };
    let mut it = measure(
        MeasureKind::Jitter,
        at_most(value, 0.015, 0.05),
        Some(value),
        format!("{:.1} mm", 1000.0 * value),
        meaning,
    );
    if it.grade != Grade::Pass {
        it.cause = Some("poses were estimated frame by frame: smooth them".to_owned());
    }
    it
}

pub(super) fn wander(value: Option<f64>) -> Measure {
    let meaning = "how far bodies wander off their masks beyond what their shape explains; detail smaller than that is lost";
    let Some(value) = value else {
        let shown = "too few frames".to_owned();
        return measure(MeasureKind::Precision, Grade::Pass, None, shown, meaning);
    };
    let mut it = measure(
        MeasureKind::Precision,
        at_most(value, PRECISE, 0.1),
        Some(value),
        format!("{:.1} mm", 1000.0 * value),
        meaning,
    );
    if it.grade != Grade::Pass {
        it.cause = Some(match value > NOISE {
            false => "poses are noisy, as estimators give them".to_owned(),
            true => "noise is not that large: left and right may be exchanged (`--mirror poses`, `limbs` or `images`, none of which \
                     fits decisively better here), or poses and masks are of other frames or people"
                .to_owned(),
        });
    }
    it
}

pub(super) fn repeats(track: &PoseTrack, skeleton: &Skeleton, seen: &[Observation]) -> Measure {
    let (frames, compared) = duplicates(track, skeleton, seen);
    let value = frames.len() as f64 / compared.max(1) as f64;
    let meaning = "frames that repeat the one before although the pose moved";
    let mut it = measure(
        MeasureKind::Duplicates,
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

pub(super) fn blur(track: &PoseTrack, seen: &[Observation]) -> Measure {
    let meaning = "width of the person's edges (sigma of a blur); finer detail can't be learnt";
    let Some(value) = median(seen.iter().filter_map(|it| it.blur)) else {
        let shown = "no texture".to_owned();
        return measure(MeasureKind::Blur, Grade::Pass, None, shown, meaning);
    };
    let mut it = measure(
        MeasureKind::Blur,
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

/// Least luma of a person's lightest pixels for a pass, and for a warning: skin and eyes are light even beside
/// black clothes, but nothing is in too little light.
const LIGHTS: [f64; 2] = [0.15, 0.05];

pub(super) fn exposure(seen: &[Observation]) -> Measure {
    let people = || seen.iter().filter(|it| it.shows_person());
    let burnt = median(people().map(|it| it.burnt)).unwrap_or(0.0);
    let black = median(people().map(|it| it.black)).unwrap_or(0.0);
    let bright = median(people().map(|it| it.brightness)).unwrap_or(0.0);
    // A frame may show a person in black from the back; the lightest frames decide.
    let mut lights: Vec<f64> = people().map(|it| it.lights).collect();
    lights.sort_by(f64::total_cmp);
    let lights = lights.get(9 * lights.len() / 10).copied().unwrap_or(0.0);
    let shown = format!(
        "{} burnt out, {} black, mean {:.2}",
        percent(burnt),
        percent(black),
        bright
    );
    let meaning = "colours at either end are lost";
    let grade = at_most(burnt, 0.05, 0.5).max(at_least(lights, LIGHTS[0], LIGHTS[1]));
    let mut it = measure(
        MeasureKind::Exposure,
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
