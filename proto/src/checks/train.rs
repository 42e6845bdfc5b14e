//! Orders to train.

use super::{SpecFault, SpecFaults};
use crate::pose_track::MAX_SIDE;
use crate::tiers::SPLATS;
use crate::v1::{AppearancePrior, ExposureLearning, PoseRefinement, TrainSpec};
use std::ops::RangeInclusive;

/// Longest training budget, seconds: 90 days. Anything longer is a unit error.
const SECONDS: RangeInclusive<f64> = 0.0..=90.0 * 86_400.0;
/// Sides of training images, pixels.
const SIDES: RangeInclusive<u32> = 8..=MAX_SIDE;
/// Time between two checkpoints of a training, seconds: each is written in full.
const CHECKPOINT_SECONDS: RangeInclusive<f64> = 0.1..=90.0 * 86_400.0;

/// Degrees of harmonics.
const DEGREES: RangeInclusive<u32> = 0..=2;

/// All faults of an order to train.
pub fn faults(train: &TrainSpec) -> Vec<SpecFault> {
    let mut found = SpecFaults::default();
    found.between("seconds", train.seconds, &SECONDS);
    let (steps, size) = (train.steps, train.image_size);
    found.unless(i64::try_from(steps).is_ok(), "steps", || {
        format!("{steps} steps are too many")
    });
    found.unless(size == 0 || SIDES.contains(&size), "image_size", || {
        let (least, most) = (SIDES.start(), SIDES.end());
        format!("{size} pixels: 0, or {least} to {most}")
    });
    // 0 leaves it to the worker.
    if train.checkpoint_seconds != 0.0 {
        found.between(
            "checkpoint_seconds",
            train.checkpoint_seconds,
            &CHECKPOINT_SECONDS,
        );
    }
    if let Some(degree) = train.harmonics {
        found.unless(DEGREES.contains(&degree), "harmonics", || {
            format!("degree {degree}: 0, 1 or 2")
        });
    }
    for (field, number, known, name) in [
        (
            "refine_poses",
            train.refine_poses,
            PoseRefinement::try_from(train.refine_poses).is_ok(),
            "PoseRefinement",
        ),
        (
            "exposure",
            train.exposure,
            ExposureLearning::try_from(train.exposure).is_ok(),
            "ExposureLearning",
        ),
        (
            "prior",
            train.prior,
            AppearancePrior::try_from(train.prior).is_ok(),
            "AppearancePrior",
        ),
    ] {
        found.unless(known, field, || {
            format!("{number} is not a value of {name}")
        });
    }
    found.0
}

/// Faults of an order to train a model of this `tier`.
pub fn of_tier(train: &TrainSpec, tier: &str) -> Vec<SpecFault> {
    let mut found = SpecFaults::default();
    let degree = train.harmonics.unwrap_or_default();
    found.unless(degree == 0 || tier == SPLATS, "harmonics", || {
        format!("the tier {tier} has fields, whose colours do not depend on the view")
    });
    found.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fields(change: fn(&mut TrainSpec)) -> Vec<String> {
        let mut spec = TrainSpec::default();
        change(&mut spec);
        faults(&spec).into_iter().map(|it| it.field).collect()
    }

    #[test]
    fn without_a_budget_a_training_runs_as_long_as_its_tier_s_schedule() {
        assert_eq!(faults(&TrainSpec::default()), []);
        assert_eq!(fields(|it| it.steps = 10), [""; 0]);
        assert_eq!(fields(|it| it.seconds = 150.0), [""; 0]);
    }

    #[test]
    fn only_splats_have_harmonics() {
        let of = |degree, tier| {
            let spec = TrainSpec {
                harmonics: Some(degree),
                ..TrainSpec::default()
            };
            of_tier(&spec, tier).len()
        };
        assert_eq!((of(2, "fast"), of(0, "fast"), of(2, SPLATS)), (1, 0, 0));
    }

    #[test]
    fn each_bad_number_is_named() {
        type Change = fn(&mut TrainSpec);
        let cases: [(Change, &str); 12] = [
            (|it| it.seconds = f64::NAN, "seconds"),
            (|it| it.seconds = f64::INFINITY, "seconds"),
            (|it| it.seconds = -1.0, "seconds"),
            (|it| it.steps = u64::MAX, "steps"),
            (|it| it.image_size = 7, "image_size"),
            (|it| it.image_size = MAX_SIDE + 1, "image_size"),
            (
                |it| it.checkpoint_seconds = f64::INFINITY,
                "checkpoint_seconds",
            ),
            (|it| it.checkpoint_seconds = 0.01, "checkpoint_seconds"),
            (|it| it.refine_poses = 9, "refine_poses"),
            (|it| it.exposure = 9, "exposure"),
            (|it| it.harmonics = Some(3), "harmonics"),
            (|it| it.prior = 9, "prior"),
        ];
        for (change, field) in cases {
            assert_eq!(fields(change), [field]);
        }
    }
}
