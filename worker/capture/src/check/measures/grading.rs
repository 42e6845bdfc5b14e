//! Grades of measured values.

use super::super::report::{Grade, Measure, MeasureKind};

pub(super) fn measure(
    kind: MeasureKind,
    grade: Grade,
    value: Option<f64>,
    shown: String,
    meaning: &str,
) -> Measure {
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
pub(super) fn at_least(value: f64, pass: f64, warn: f64) -> Grade {
    if value >= pass {
        Grade::Pass
    } else if value >= warn {
        Grade::Warn
    } else {
        Grade::Fail
    }
}

pub(super) fn at_most(value: f64, pass: f64, warn: f64) -> Grade {
    at_least(-value, -pass, -warn)
}

pub(super) fn percent(share: f64) -> String {
    // An empty sum of floats is -0.0, which would be printed with its sign.
    format!("{:.1} %", 100.0 * share + 0.0)
}

/// The measure of a share; `None` if no frame shows a person.
pub(super) fn share(
    kind: MeasureKind,
    value: Option<f64>,
    bounds: [f64; 2],
    meaning: &str,
) -> Measure {
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

pub(super) fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
