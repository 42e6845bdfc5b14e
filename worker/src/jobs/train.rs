//! Trains one model on all people with a slot in it, from its newest complete checkpoint.
//!
//! A model can have several train jobs: each adds its own budget to earlier training, and a job
//! that is leased again continues with the rest of its budget.

mod leave;
mod outlook;
mod plan;
mod preview;
mod saving;
mod session;

use super::{JobContext, JobFailure, checkpoint};
pub(in crate::jobs) use plan::HOLDOUT_EVERY;
use plan::Plan;
use session::Session;
use yoto_avatar::config::ModelConfig;
use yoto_avatar::train::{TrainError, Trainer};
use yoto_capture::CaptureError;
use yoto_proto::manifest::files;
use yoto_proto::v1::{Progress, TrainResult, TrainSpec};
use yoto_proto::worker::v1::Inputs;

/// Trains until the budget is used up, and publishes the last checkpoint.
///
/// # Errors
/// Bad requests, missing captures, faults of the store, and divergence. A cancelled or
/// interrupted training publishes a checkpoint before it ends.
pub fn run(
    context: &JobContext,
    spec: &TrainSpec,
    inputs: &Inputs,
) -> Result<TrainResult, JobFailure> {
    if !spec.leave.is_empty() {
        return leave::run(context, spec, inputs);
    }
    let plan = Plan::new(spec, inputs)?;
    let mut session = start(context, &plan, inputs)?;
    match session.train() {
        Ok(()) => session.finish(),
        Err(stopped @ (JobFailure::Cancelled | JobFailure::Requeue)) => {
            match session.last_checkpoint() {
                Err(JobFailure::LeaseLost) => Err(JobFailure::LeaseLost),
                Err(failure) => {
                    tracing::warn!(
                        job = context.claim.job,
                        ?failure,
                        "the last checkpoint could not be written"
                    );
                    Err(stopped)
                }
                Ok(()) => Err(stopped),
            }
        }
        Err(failure) => Err(failure),
    }
}

/// Loads the people, then the newest complete checkpoint or a new network.
fn start<'a>(
    context: &'a JobContext,
    plan: &'a Plan,
    inputs: &Inputs,
) -> Result<Session<'a>, JobFailure> {
    let people = plan.people(context, inputs)?;
    context.report(Progress {
        phase: "starting".into(),
        ..Progress::default()
    });
    let wanted = [files::WEIGHTS, files::OPTIMISER, files::STATE];
    let before = checkpoint::first_whole(context, &inputs.checkpoints, &wanted)?;
    let config = ModelConfig::named(&plan.model.tier, &plan.model.variant)
        .map_err(|error| JobFailure::invalid("train", "model", error.to_string()))?;
    let manifest = before.as_ref().map(|found| &found.manifest);
    let options = plan.options(
        &context.claim.job,
        manifest,
        config.schedule.steps,
        context.lpips.clone(),
        &context.scratch,
    );
    let used = (options.used_seconds, options.used_steps);
    let device = &context.device.device;
    let published = before
        .as_ref()
        .map(|found| (found.manifest.step, found.manifest.bytes()));
    let trainer = match before {
        Some(found) => {
            tracing::info!(
                job = context.claim.job,
                step = found.manifest.step,
                "training resumes"
            );
            Trainer::resume(found.folder.path(), options, people, device)
        }
        None => {
            // A new start would replace a trained model by an untrained one.
            if !inputs.checkpoints.is_empty() {
                return Err(JobFailure::Failed {
                    code: "CHECKPOINTS_TORN",
                    message: format!(
                        "none of the {} newest checkpoints of {} is complete",
                        inputs.checkpoints.len(),
                        plan.model.display_name
                    ),
                });
            }
            Trainer::new(config, options, people, device)
        }
    }
    .map_err(|error| failure("starting the training", &error))?;
    Ok(Session::new(context, plan, trainer, used, published))
}

/// The report to the coordinator for an error of the trainer.
fn failure(doing: &str, error: &TrainError) -> JobFailure {
    match error {
        TrainError::Diverged { .. } => JobFailure::failed("DIVERGED", doing, error),
        // Films go to this machine's disk.
        TrainError::Capture {
            source: CaptureError::Io { .. },
            ..
        } => JobFailure::machine(doing, error),
        _ => JobFailure::failed("TRAINING", doing, error),
    }
}
