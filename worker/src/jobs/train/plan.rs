//! The checked request of a train job, and the people it trains on.

use crate::jobs::{JobContext, JobFailure, shard};
use std::time::Duration;
use yoto_avatar::config::{LearnExposure, Refine};
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_avatar::train::{Budget, Person, TrainOptions, Validation};
use yoto_proto::{
    manifest::Manifest,
    pose_track::{MAX_SIDE, violation},
    v1::{ExposureLearning, Inputs, Model, PoseRefinement, TrainSpec, Violation},
};

/// Every n-th frame is held out to measure PSNR and SSIM: with 1 in 20, enough of a short capture
/// remains for training.
pub(in crate::jobs) const HOLDOUT_EVERY: usize = 20;
/// Smallest useful side of training images, pixels.
const MIN_SIDE: u32 = 8;
/// Longest budget, seconds: a year. Anything longer is a unit error.
const MAX_SECONDS: f64 = 366.0 * 86_400.0;

/// A checked train job.
pub(super) struct Plan {
    pub(super) model: Model,
    /// Time between checkpoints, if the request chooses it.
    pub(super) checkpoint_every: Option<Duration>,
    /// Longest side of the training images, pixels; 0: the captures' own.
    image_size: u32,
    /// SHA-256 of the shards, in the order of the slots.
    pub(super) shards: Vec<String>,
    spec: TrainSpec,
}

impl Plan {
    /// Longest side of the training images, pixels; 0: the captures' own.
    pub(super) fn image_size(&self) -> u32 {
        self.image_size
    }

    pub(super) fn new(spec: &TrainSpec, inputs: &Inputs) -> Result<Self, JobFailure> {
        let violations = check(spec);
        if !violations.is_empty() {
            return Err(JobFailure::Invalid(violations));
        }
        let model = inputs.model.clone().ok_or_else(|| {
            JobFailure::invalid(
                "train",
                "model",
                format!("there is no model {}", spec.model),
            )
        })?;
        if model.slots.is_empty() {
            return Err(JobFailure::invalid(
                "train",
                "model",
                format!("there are no people in {}", model.name),
            ));
        }
        let chosen = spec.checkpoint_seconds;
        // A training that goes on keeps its size, unless the request has another.
        let before = inputs.checkpoints.first().map_or(0, |it| it.image_size);
        let shard = |subject: &str| {
            let entry = inputs.shards.iter().find(|it| it.subject == subject)?;
            Some(entry.shard.as_ref()?.sha256.clone())
        };
        let shards = model.slots.iter().filter_map(|slot| shard(&slot.subject));
        Ok(Self {
            shards: shards.collect(),
            model,
            image_size: match spec.image_size {
                0 => before,
                asked => asked,
            },
            checkpoint_every: (chosen > 0.0).then(|| Duration::from_secs_f64(chosen)),
            spec: spec.clone(),
        })
    }

    /// The options of a training that goes on after `before`, whose budget counts when the
    /// same job spent it. Without a budget it has `run` steps.
    pub(super) fn options(
        &self,
        job: &str,
        before: Option<&Manifest>,
        run: u64,
        lpips: Option<LpipsWeights>,
    ) -> TrainOptions {
        let own = before.filter(|manifest| manifest.job == job);
        TrainOptions {
            budget: match (self.spec.steps, self.spec.seconds) {
                (0, 0.0) => Budget::Steps(run),
                (0, seconds) => Budget::Seconds(seconds),
                (steps, _) => Budget::Steps(steps),
            },
            seed: self.spec.seed,
            image_size: self.image_size,
            validation: Validation::Every(HOLDOUT_EVERY),
            refine_poses: match self.spec.refine_poses() {
                PoseRefinement::Unspecified => None,
                PoseRefinement::Always => Some(Refine::Always),
                PoseRefinement::Never => Some(Refine::Never),
                PoseRefinement::Auto => Some(Refine::Auto),
            },
            exposure: match self.spec.exposure() {
                ExposureLearning::Unspecified => None,
                ExposureLearning::Always => Some(LearnExposure::Always),
                ExposureLearning::Never => Some(LearnExposure::Never),
                ExposureLearning::Auto => Some(LearnExposure::Auto),
            },
            leave_unseen: self.spec.leave_unseen,
            lpips,
            used_seconds: own.map_or(0.0, |manifest| manifest.job_seconds),
            used_steps: own.map_or(0, |manifest| manifest.job_steps),
        }
    }

    /// All people with a slot, with their frames.
    pub(super) fn people(
        &self,
        context: &JobContext,
        inputs: &Inputs,
    ) -> Result<Vec<Person>, JobFailure> {
        let mut people = Vec::new();
        for (done, slot) in self.model.slots.iter().enumerate() {
            context.check()?;
            context.report_pieces("loading", done, self.model.slots.len());
            let (name, shard) = shard::fetch(context, inputs, &slot.subject)?;
            people.push(Person {
                slot: slot.slot as usize,
                name,
                shard,
            });
        }
        Ok(people)
    }
}

fn check(spec: &TrainSpec) -> Vec<Violation> {
    let mut found = Vec::new();
    let mut add = |field: &str, message: String| {
        found.push(violation("OUT_OF_RANGE", "train", None, field, message));
    };
    let TrainSpec {
        seconds,
        image_size,
        checkpoint_seconds,
        refine_poses,
        exposure,
        ..
    } = *spec;
    if !(0.0..=MAX_SECONDS).contains(&seconds) {
        add(
            "seconds",
            format!("{seconds} is not between 0 and {MAX_SECONDS}"),
        );
    }
    if image_size != 0 && !(MIN_SIDE..=MAX_SIDE).contains(&image_size) {
        add(
            "image_size",
            format!("{image_size} pixels: 0, or {MIN_SIDE} to {MAX_SIDE}"),
        );
    }
    if !(0.0..=MAX_SECONDS).contains(&checkpoint_seconds) {
        add(
            "checkpoint_seconds",
            format!("{checkpoint_seconds} is not between 0 and {MAX_SECONDS}"),
        );
    }
    if PoseRefinement::try_from(refine_poses).is_err() {
        add(
            "refine_poses",
            format!("{refine_poses} is not a value of PoseRefinement"),
        );
    }
    if ExposureLearning::try_from(exposure).is_err() {
        add(
            "exposure",
            format!("{exposure} is not a value of ExposureLearning"),
        );
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_bad_number_is_named() {
        let good = TrainSpec {
            seconds: 150.0,
            ..TrainSpec::default()
        };
        assert_eq!(check(&good), []);
        assert_eq!(
            check(&TrainSpec {
                steps: 5,
                ..TrainSpec::default()
            }),
            []
        );
        for (spec, field) in [
            (
                TrainSpec {
                    seconds: f64::NAN,
                    ..good.clone()
                },
                "seconds",
            ),
            (
                TrainSpec {
                    seconds: -1.0,
                    ..good.clone()
                },
                "seconds",
            ),
            (
                TrainSpec {
                    image_size: 7,
                    ..good.clone()
                },
                "image_size",
            ),
            (
                TrainSpec {
                    checkpoint_seconds: f64::INFINITY,
                    ..good.clone()
                },
                "checkpoint_seconds",
            ),
            (
                TrainSpec {
                    refine_poses: 9,
                    ..good.clone()
                },
                "refine_poses",
            ),
            (
                TrainSpec {
                    exposure: 9,
                    ..good.clone()
                },
                "exposure",
            ),
        ] {
            let fields: Vec<String> = check(&spec).into_iter().map(|v| v.field).collect();
            assert_eq!(fields, [field]);
        }
    }

    #[test]
    fn only_its_own_job_counts_against_the_budget() {
        let inputs = Inputs {
            model: Some(Model {
                slots: vec![Default::default()],
                ..Model::default()
            }),
            ..Inputs::default()
        };
        let spec = TrainSpec {
            seconds: 60.0,
            ..TrainSpec::default()
        };
        let plan = Plan::new(&spec, &inputs).expect("a plan");
        let before = Manifest {
            version: 1,
            model: "models/m".into(),
            step: 900,
            job: "jobs/a".into(),
            job_seconds: 20.0,
            job_steps: 300,
            objects: Vec::new(),
        };
        let used = |job, before| {
            let options = plan.options(job, before, 5000, None);
            (options.used_seconds, options.used_steps)
        };
        assert_eq!(used("jobs/a", Some(&before)), (20.0, 300));
        assert_eq!(used("jobs/b", Some(&before)), (0.0, 0));
        assert_eq!(used("jobs/a", None), (0.0, 0));
        assert_eq!(
            plan.options("jobs/a", None, 5000, None).budget,
            Budget::Seconds(60.0)
        );
        let spec = TrainSpec::default();
        let plan = Plan::new(&spec, &inputs).expect("no budget is valid");
        assert_eq!(
            plan.options("jobs/a", None, 5000, None).budget,
            Budget::Steps(5000)
        );
    }
}
