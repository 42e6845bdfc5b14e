//! The checked request of a train job, and the people it trains on.

use crate::jobs::{JobContext, JobFailure, shard};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use yoto_avatar::config::{LearnExposure, Refine};
use yoto_avatar::decoder::Prior;
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_avatar::train::{Budget, Learn, TrainOptions, TrainPerson, Validation};
use yoto_proto::checks::train;
use yoto_proto::manifest::Manifest;
use yoto_proto::v1::{IdentitySlot, Model, TrainSpec};
use yoto_proto::worker::v1::Inputs;

/// Every n-th frame is held out to measure PSNR and SSIM: with 1 in 20, enough of a short capture
/// remains for training.
pub(in crate::jobs) const HOLDOUT_EVERY: usize = 20;

/// A checked train job.
pub(super) struct Plan {
    pub(super) model: Model,
    /// Time between checkpoints, if the request chooses it.
    pub(super) checkpoint_every: Option<Duration>,
    /// Longest side of the training images, pixels; 0: the captures' own.
    image_size: u32,
    /// Whose parameters change.
    learn: Learn,
    /// The people to train on.
    slots: Vec<IdentitySlot>,
    /// SHA-256 of their shards, in the order of the slots.
    pub(super) shards: Vec<String>,
    spec: TrainSpec,
}

impl Plan {
    /// Longest side of the training images, pixels; 0: the captures' own.
    pub(super) fn image_size(&self) -> u32 {
        self.image_size
    }

    pub(super) fn new(spec: &TrainSpec, inputs: &Inputs) -> Result<Self, JobFailure> {
        JobFailure::refuse("train", train::faults(spec))?;
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
        let (learn, slots) = who(spec, &model)?;
        let chosen = spec.checkpoint_seconds;
        // A resumed training keeps its size, unless the request has another.
        let before = inputs.checkpoints.first().map_or(0, |it| it.image_size);
        let shard = |subject: &str| {
            let entry = inputs.shards.iter().find(|it| it.subject == subject)?;
            Some(entry.shard.as_ref()?.sha256.clone())
        };
        let shards = slots.iter().filter_map(|slot| shard(&slot.subject));
        Ok(Self {
            shards: shards.collect(),
            learn,
            slots,
            model,
            image_size: match spec.image_size {
                0 => before,
                asked => asked,
            },
            checkpoint_every: (chosen > 0.0).then(|| Duration::from_secs_f64(chosen)),
            spec: spec.clone(),
        })
    }

    /// The options of a training that resumes after `before`, whose budget counts when the same job
    /// spent it. Without a budget it has `run` steps. Films are in the folder `scratch`.
    pub(super) fn options(
        &self,
        job: &str,
        before: Option<&Manifest>,
        run: u64,
        lpips: Option<LpipsWeights>,
        scratch: &Path,
    ) -> TrainOptions {
        let own = before.filter(|manifest| manifest.job == job);
        TrainOptions {
            budget: match (self.spec.steps, self.spec.seconds) {
                (0, 0.0) => Budget::Steps(run),
                (0, seconds) => Budget::Seconds(seconds),
                (steps, _) => Budget::Steps(steps),
            },
            learn: self.learn,
            seed: self.spec.seed,
            image_size: self.image_size,
            scratch: Some(scratch.to_owned()),
            validation: Validation::Every(HOLDOUT_EVERY),
            refine_poses: Refine::ordered(self.spec.refine_poses()),
            exposure: LearnExposure::ordered(self.spec.exposure()),
            harmonics: self.spec.harmonics.map(|degree| degree as usize),
            leave_unseen: self.spec.leave_unseen,
            prior: Prior::ordered(self.spec.prior()),
            lpips,
            used_seconds: own.map_or(0.0, |manifest| manifest.job_seconds),
            used_steps: own.map_or(0, |manifest| manifest.job_steps),
        }
    }

    /// The people to train on, with their frames.
    pub(super) fn people(
        &self,
        context: &JobContext,
        inputs: &Inputs,
    ) -> Result<Vec<TrainPerson>, JobFailure> {
        let mut people = Vec::new();
        for (done, slot) in self.slots.iter().enumerate() {
            context.check()?;
            context.report_pieces("loading", done, self.slots.len());
            let (name, shard) = shard::fetch(context, inputs, &slot.subject)?;
            let shard = Arc::unwrap_or_clone(shard).kept_in(&context.scratch);
            let shard =
                shard.map_err(|error| JobFailure::machine("the film of a person", &error))?;
            people.push(TrainPerson {
                slot: slot.slot as usize,
                name,
                shard: Arc::new(shard),
            });
        }
        Ok(people)
    }
}

/// Whose parameters change, and the people to train on.
fn who(spec: &TrainSpec, model: &Model) -> Result<(Learn, Vec<IdentitySlot>), JobFailure> {
    if spec.only.is_empty() {
        return Ok((Learn::Everything, model.slots.clone()));
    }
    let own = model.slots.iter().find(|slot| slot.subject == spec.only);
    let own = own.ok_or_else(|| {
        let message = format!("{} has no slot in {}", spec.only, model.name);
        JobFailure::invalid("train", "only", message)
    })?;
    let slot = own.slot as usize;
    Ok((Learn::Own { slot }, vec![own.clone()]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_order_that_its_checks_refuse_is_refused() {
        let spec = TrainSpec {
            seconds: -1.0,
            ..TrainSpec::default()
        };
        let refused = Plan::new(&spec, &Inputs::default()).err();
        let Some(JobFailure::Invalid(found)) = refused else {
            panic!("{refused:?}");
        };
        assert_eq!(found[0].field, "seconds");
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
            let options = plan.options(job, before, 5000, None, Path::new("scratch"));
            (options.used_seconds, options.used_steps)
        };
        assert_eq!(used("jobs/a", Some(&before)), (20.0, 300));
        assert_eq!(used("jobs/b", Some(&before)), (0.0, 0));
        assert_eq!(used("jobs/a", None), (0.0, 0));
        assert_eq!(
            plan.options("jobs/a", None, 5000, None, Path::new("scratch"))
                .budget,
            Budget::Seconds(60.0)
        );
        let spec = TrainSpec::default();
        let plan = Plan::new(&spec, &inputs).expect("no budget is valid");
        assert_eq!(
            plan.options("jobs/a", None, 5000, None, Path::new("scratch"))
                .budget,
            Budget::Steps(5000)
        );
    }
}
