//! Splats distilled from a person that the model represents as a field.

use super::{DistilledSplats, count, of_motion, splats};
use crate::jobs::{JobContext, JobFailure};
use std::time::{Duration, Instant};
use yoto_avatar::distill::{CaptureFrame, DistillError, DistillStage, StudentTraining, Teacher};
use yoto_avatar::render::{Renderer, SkinnedSplats};
use yoto_capture::skeleton::Skeleton;
use yoto_capture::{CaptureError, Shard};
use yoto_export::source::Source;
use yoto_proto::exports;
use yoto_proto::v1::{Checkpoint, Distillation, ObjectRef, Progress};

/// Pause between two progress messages.
const REPORT_EVERY: Duration = Duration::from_millis(250);
/// Share of the job that a distillation is; the rest writes the files.
pub(super) const SHARE: f64 = 0.95;
/// The fraction of progress from which on the remaining time is estimated.
const SOON: f64 = 0.02;
/// Seed of the training, as of `yoto-lab distill`.
const SEED: u64 = 7;

/// Splats to make.
pub(super) struct Order<'a> {
    pub(super) context: &'a JobContext,
    /// What the model is, and what it was trained on.
    pub(super) checkpoint: &'a Checkpoint,
    /// The capture of the person, in the store.
    pub(super) shard: Option<&'a ObjectRef>,
    /// The model of fields.
    pub(super) renderer: &'a Renderer,
    /// The person's slot in it.
    pub(super) slot: usize,
    pub(super) wanted: Option<&'a Distillation>,
    /// Name of the person.
    pub(super) name: &'a str,
}

impl Order<'_> {
    /// Makes splats of the person with this `body`, in the poses of their own capture.
    pub(super) fn run(
        &self,
        capture: &Shard,
        body: &Skeleton,
    ) -> Result<(SkinnedSplats, DistilledSplats), JobFailure> {
        let context = self.context;
        let (seconds, size) = exports::distillation(self.wanted);
        let own = Source::track(self.name, &capture.track);
        let own = own.map_err(|error| of_motion(&error))?;
        let poses = own.poses(body).map_err(|error| of_motion(&error))?;
        let alone = self.wanted.is_some_and(|it| it.field_only) || !self.is_known(capture, body);
        let capture_frames = match alone {
            true => Vec::new(),
            false => CaptureFrame::of(capture, &poses, size).map_err(|error| failure(&error))?,
        };
        let teacher = Teacher {
            renderer: self.renderer,
            slot: self.slot,
            poses: &poses,
            up: own.up(),
            size: CaptureFrame::size(&capture_frames).unwrap_or([size; 2]),
            capture_frames: &capture_frames,
        };
        let training = StudentTraining {
            name: self.name.to_owned(),
            seconds,
            seed: SEED,
            scratch: Some(context.scratch.clone()),
        };
        let began = Instant::now();
        let mut told: Option<Instant> = None;
        let tell = &mut |stage: DistillStage, fraction: f64| {
            if told.is_none_or(|it| it.elapsed() >= REPORT_EVERY) {
                told = Some(Instant::now());
                // A slow field takes longer than it should.
                let pace = began.elapsed().as_secs_f64() / fraction.max(SOON);
                let left = (1.0 - fraction) * if fraction < SOON { seconds } else { pace };
                context.report(progress(&stage, fraction, left));
            }
        };
        let keep_going = &mut || context.check().is_ok();
        let made = training.run(&teacher, &context.device.device, tell, keep_going);
        let made = made.map_err(|error| {
            // Why it must stop.
            let stopped = context.check().err();
            stopped.unwrap_or_else(|| failure(&error))
        })?;
        let progress = made.trainer.progress();
        let person = splats(&made.trainer.renderer(), 0)?.ok_or_else(|| JobFailure::Failed {
            code: "INTERNAL",
            message: "the distilled model has no splats".into(),
        })?;
        let distilled = DistilledSplats {
            pictures: count(made.pictures),
            frames: count(capture_frames.len()),
            seconds: made.time.as_secs_f64(),
            psnr_mask_box: progress.psnr_mask_box,
            psnr: progress.psnr,
        };
        Ok((person, distilled))
    }

    /// Whether the model learned from the `capture`: the person may have been filmed again since, in other clothes.
    fn is_known(&self, capture: &Shard, body: &Skeleton) -> bool {
        let same = Skeleton::from_track(&capture.track.skeleton).is_ok_and(|it| it == *body);
        let Checkpoint { shards, slots, .. } = self.checkpoint;
        // A training of one person names no capture of the others, and earlier versions named none.
        let named = shards.len() == slots.len();
        same && (!named || self.shard.is_some_and(|it| shards.contains(&it.sha256)))
    }
}

/// The progress to report in a `stage`, when a `fraction` of the work is done and seconds are left.
fn progress(stage: &DistillStage, fraction: f64, seconds_left: f64) -> Progress {
    let common = Progress {
        fraction: SHARE * fraction,
        seconds_left: (seconds_left > 0.0).then_some(seconds_left),
        ..Progress::default()
    };
    match stage {
        DistillStage::Rendering(pictures) => Progress {
            phase: "rendering the field".into(),
            step: *pictures as u64,
            ..common
        },
        DistillStage::Training(now) => Progress {
            phase: "training splats".into(),
            step: now.step,
            steps_per_second: now.steps_per_second,
            loss: Some(now.loss),
            skipped_steps: now.skipped_steps,
            rollbacks: now.rollbacks,
            objective: now.objective.into(),
            train_seconds: now.train_seconds,
            ..common
        },
    }
}

fn failure(error: &DistillError) -> JobFailure {
    let doing = "making splats of the field";
    match error {
        // Films go to this machine's disk.
        DistillError::Capture(CaptureError::Io { .. }) => JobFailure::machine(doing, error),
        error => JobFailure::failed("DISTILLATION", doing, error),
    }
}
