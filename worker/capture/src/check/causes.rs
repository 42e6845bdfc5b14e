//! The likeliest cause of a bad fit. Each common mistake is undone, alone and together with one other.
//! If bodies and masks then agree decisively better, that mistake is named.

use super::fit::{Fit, Fitter};
use super::report::{Cause, Tried};
use yoto_proto::correction::{CameraAxes, Correction, Extrinsics, Mirror, Unit, Units};

/// Least gain in overlap for a cause, and for a second mistake beside the first.
const GAIN: f64 = 0.05;
const SECOND_GAIN: f64 = 0.08;
/// Least gain in standard errors.
const ERRORS: f64 = 4.0;
/// Least overlap of a reading that explains anything.
const FITS: f64 = 0.4;
/// Greatest difference in overlap from the best for a reading that is named beside it.
const AS_GOOD: f64 = 0.01;
/// Readings kept in the report.
const KEPT: usize = 12;
/// Scales of the intrinsics are tried at 2^(i/4) for i from `-OCTAVES` to `OCTAVES`: up to a factor of 11
/// either way.
const OCTAVES: i32 = 14;
/// Ratios between common image sizes. A fitted scale near one of them is rounded to it.
const RATIOS: [f64; 13] = [
    0.125,
    0.25,
    1.0 / 3.0,
    0.5,
    2.0 / 3.0,
    0.75,
    0.8,
    1.25,
    4.0 / 3.0,
    1.5,
    2.0,
    3.0,
    4.0,
];
const NEAR: f64 = 0.02;

/// The correction of one mistake. Two of the same group exclude each other.
#[derive(Clone, Copy)]
struct Step {
    group: u8,
    undo: fn(&mut Correction),
}

/// All corrections, the most common mistake first: of readings that fit equally well the first is named.
fn steps() -> Vec<Step> {
    macro_rules! step {
        ($group:expr, $c:ident => $change:expr) => {
            Step {
                group: $group,
                undo: |$c| $change,
            }
        };
    }
    use Unit::{Centimetre as Cm, Metre as M, Millimetre as Mm};
    const fn units(camera: Unit, root: Unit, skeleton: Unit) -> Units {
        Units {
            camera,
            root,
            skeleton,
        }
    }
    vec![
        step!(0, c => c.extrinsics = Extrinsics::CameraToWorld),
        step!(1, c => c.units = units(Mm, M, M)),
        step!(1, c => c.units = units(Cm, M, M)),
        step!(1, c => c.units = units(Mm, Mm, M)),
        step!(1, c => c.units = units(Cm, Cm, M)),
        step!(1, c => c.units = units(M, Mm, M)),
        step!(1, c => c.units = units(M, Cm, M)),
        step!(1, c => c.units = units(M, M, Mm)),
        step!(1, c => c.units = units(M, M, Cm)),
        step!(1, c => c.units = units(M, Mm, Mm)),
        step!(1, c => c.units = units(M, Cm, Cm)),
        step!(2, c => c.mirror = Mirror::Poses),
        step!(2, c => c.mirror = Mirror::Images),
        step!(2, c => c.mirror = Mirror::Limbs),
        step!(2, c => c.mirror = Mirror::Labels),
        step!(3, c => c.camera_axes = CameraAxes::OpenGl),
        step!(4, c => c.turn_bodies = -90.0),
        step!(4, c => c.turn_bodies = 90.0),
        step!(4, c => c.turn_bodies = 180.0),
    ]
}

/// A reading and its fit.
struct Reading {
    correction: Correction,
    fit: Fit,
}

/// The result of trying all readings.
pub(super) struct Search {
    /// Fit of the numbers as given.
    pub given: Fit,
    /// The reading for the further measures: the given one unless another is decisively better.
    pub best: Correction,
    /// Its fit.
    pub best_fit: Fit,
    /// The mistake, if there is one.
    pub cause: Option<Cause>,
    /// The readings that fitted best.
    pub tried: Vec<Tried>,
}

/// Tries all readings; `None` without a frame to try them on.
pub(super) fn search(fitter: &mut Fitter<'_>) -> Option<Search> {
    let none = Correction::default();
    let given = fitter.fit(&none).filter(|fit| !fit.overlaps.is_empty())?;
    let mut singles = Vec::new();
    for step in steps() {
        let mut correction = none;
        (step.undo)(&mut correction);
        push(fitter, &mut singles, correction);
    }
    let rescaled = scaled(fitter, none);
    push(fitter, &mut singles, rescaled);
    let single = best(&singles).filter(|it| decisive(&it.fit, &given, GAIN));
    let so_far = single.map_or(&given, |it| &it.fit);

    let mut pairs = Vec::new();
    let steps = steps();
    for (i, one) in steps.iter().enumerate() {
        for other in steps[i + 1..].iter().filter(|it| it.group != one.group) {
            let mut correction = none;
            (one.undo)(&mut correction);
            (other.undo)(&mut correction);
            push(fitter, &mut pairs, correction);
        }
    }
    // A fit of the scale takes many tries, so it is combined only with mistakes that a scale can hide.
    for step in steps.iter().filter(|step| step.group != 1) {
        let mut correction = none;
        (step.undo)(&mut correction);
        let correction = scaled(fitter, correction);
        push(fitter, &mut pairs, correction);
    }
    let pair = best(&pairs)
        .filter(|it| decisive(&it.fit, so_far, SECOND_GAIN) && decisive(&it.fit, &given, GAIN));
    let chosen = pair.or(single);
    let rivals = if pair.is_some() { &pairs } else { &singles };
    let cause = chosen.map(|it| cause(it, rivals, &given));

    let mut all: Vec<&Reading> = singles.iter().chain(&pairs).collect();
    all.sort_by(|a, b| b.fit.mean.total_cmp(&a.fit.mean));
    let as_given = Tried {
        options: String::new(),
        fit: given.mean,
    };
    let others = all.iter().take(KEPT).map(|it| Tried {
        options: it.correction.to_string(),
        fit: it.fit.mean,
    });
    Some(Search {
        best: chosen.map_or(none, |it| it.correction),
        best_fit: chosen.map_or_else(|| given.clone(), |it| it.fit.clone()),
        cause,
        tried: std::iter::once(as_given).chain(others).collect(),
        given,
    })
}

fn push(fitter: &mut Fitter<'_>, readings: &mut Vec<Reading>, correction: Correction) {
    if let Some(fit) = fitter.fit(&correction) {
        readings.push(Reading { correction, fit });
    }
}

/// The first of the readings that are as good as the best.
fn best(readings: &[Reading]) -> Option<&Reading> {
    let top = readings.iter().map(|it| it.fit.mean).fold(0.0, f64::max);
    readings.iter().find(|it| it.fit.mean >= top - AS_GOOD)
}

fn decisive(fit: &Fit, over: &Fit, least: f64) -> bool {
    let (gain, error) = fit.gain_over(over);
    fit.mean >= FITS && gain >= least.max(ERRORS * error)
}

/// `correction` with the best scale of the intrinsics, by a coarse scan and then a narrowing search.
fn scaled(fitter: &mut Fitter<'_>, correction: Correction) -> Correction {
    let at = |scale: f64| Correction {
        k_scale: scale,
        ..correction
    };
    let mut fit = |scale: f64| fitter.fit(&at(scale)).map_or(0.0, |fit| fit.mean);
    let mut scale = 1.0;
    let mut highest = 0.0;
    for i in (-OCTAVES..=OCTAVES).filter(|&i| i != 0) {
        let candidate = (0.25 * f64::from(i)).exp2();
        let mean = fit(candidate);
        if mean > highest {
            (scale, highest) = (candidate, mean);
        }
    }
    let mut step = 1.09;
    while step > 1.003 {
        for candidate in [scale * step, scale / step] {
            let mean = fit(candidate);
            if mean > highest {
                (scale, highest) = (candidate, mean);
            }
        }
        step = 1.0 + (step - 1.0) / 2.0;
    }
    let near = |ratio: &&f64| (scale / **ratio - 1.0).abs() < NEAR;
    at(RATIOS.iter().find(near).copied().unwrap_or(scale))
}

fn cause(reading: &Reading, rivals: &[Reading], given: &Fit) -> Cause {
    let options = reading.correction.to_string();
    let close = |it: &&Reading| it.fit.mean >= reading.fit.mean - AS_GOOD;
    let others = rivals
        .iter()
        .filter(close)
        .map(|it| it.correction.to_string());
    Cause {
        what: what(&reading.correction),
        alternatives: others.filter(|it| *it != options).take(3).collect(),
        options,
        correction: Some(reading.correction),
        fit: given.mean,
        fit_mended: reading.fit.mean,
    }
}

/// The mistakes in words.
pub(super) fn what(correction: &Correction) -> String {
    let mut parts = Vec::new();
    if correction.extrinsics == Extrinsics::CameraToWorld {
        parts.push("extrinsics look camera-to-world (inverted)".to_owned());
    }
    if correction.camera_axes == CameraAxes::OpenGl {
        parts.push("cameras look OpenGL (y up, z backward)".to_owned());
    }
    let Units {
        camera,
        root,
        skeleton,
    } = correction.units;
    let lengths = [
        (camera, "camera translations"),
        (root, "root translations"),
        (skeleton, "rest joints"),
    ];
    for unit in [Unit::Millimetre, Unit::Centimetre] {
        let these: Vec<&str> = lengths
            .iter()
            .filter(|(it, _)| *it == unit)
            .map(|(_, name)| *name)
            .collect();
        if !these.is_empty() {
            let unit = match unit {
                Unit::Centimetre => "centimetres",
                _ => "millimetres",
            };
            let these = match these.len() {
                3 => "all lengths".to_owned(),
                _ => these.join(" and "),
            };
            parts.push(format!("{these} look like {unit}"));
        }
    }
    match correction.mirror {
        Mirror::None => {}
        Mirror::Poses => parts.push("poses look mirrored, left for right".to_owned()),
        Mirror::Limbs => parts.push("limbs look mirrored, left for right".to_owned()),
        Mirror::Labels => parts.push("left and right joints look exchanged".to_owned()),
        Mirror::Images => parts.push("images look mirrored, left for right".to_owned()),
    }
    if correction.turn_bodies == 180.0 {
        parts.push("bodies stand upside down: poses look y-down".to_owned());
    } else if correction.turn_bodies != 0.0 {
        parts.push("bodies lie: poses and cameras disagree about which axis is up".to_owned());
    }
    if correction.k_scale != 1.0 {
        parts.push(format!(
            "K looks made for images {:.3} times as large",
            1.0 / correction.k_scale
        ));
    }
    parts.join(", and ")
}
