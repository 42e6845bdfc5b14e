//! The training loop of one lease: step, report, validate, checkpoint.

use super::outlook::{Outlook, VALIDATIONS};
use super::plan::Plan;
use super::saving::{Rhythm, Upload};
use super::{failure, preview};
use crate::jobs::checkpoint::{Saved, local, publish};
use crate::jobs::{JobContext, JobFailure};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use yoto_avatar::train::Trainer;
use yoto_proto::backoff::Backoff;
use yoto_proto::manifest::files;
use yoto_proto::names;
use yoto_proto::v1::{Progress, TrainResult};

/// Pause between two progress messages.
const REPORT_EVERY: Duration = Duration::from_millis(250);
/// Longest wait of a trained model for a disk or a store that can take it; after it the job waits in the
/// queue, and resumes from its last checkpoint.
const PATIENCE: Duration = Duration::from_secs(900);
const LONGEST_PAUSE: Duration = Duration::from_secs(30);

/// The part of a training within one lease.
pub(super) struct Session<'a> {
    context: &'a JobContext,
    plan: &'a Plan,
    trainer: Trainer,
    /// Seconds and steps that earlier leases of this job trained.
    used: (f64, u64),
    /// The trainer's counts at the start of this lease.
    began: (f64, u64),
    /// Start of this lease, and the share of the job that earlier ones had done.
    since: (Instant, f64),
    outlook: Outlook,
    next_validation: f64,
    /// Step of the last validation.
    validated: Option<u64>,
    /// Step and bytes of the model's newest checkpoint.
    published: Option<(u64, u64)>,
    /// A checkpoint on its way to the store.
    upload: Option<Upload>,
    rhythm: Rhythm,
}

impl<'a> Session<'a> {
    pub(super) fn new(
        context: &'a JobContext,
        plan: &'a Plan,
        trainer: Trainer,
        used: (f64, u64),
        published: Option<(u64, u64)>,
    ) -> Self {
        let progress = trainer.progress();
        Self {
            context,
            plan,
            used,
            began: (progress.train_seconds, progress.step),
            since: (Instant::now(), progress.fraction),
            outlook: Outlook::default(),
            next_validation: validation_after(progress.fraction),
            validated: None,
            trainer,
            published,
            upload: None,
            rhythm: Rhythm::new(plan.checkpoint_every, Instant::now()),
        }
    }

    /// Trains until the budget is used up or the job must stop.
    pub(super) fn train(&mut self) -> Result<(), JobFailure> {
        let mut reported = Instant::now();
        self.report("training");
        while !self.trainer.finished() {
            self.context.check()?;
            self.trainer
                .step()
                .map_err(|error| failure("a training step", &error))?;
            if reported.elapsed() >= REPORT_EVERY {
                self.report("training");
                reported = Instant::now();
            }
            if self.trainer.progress().fraction >= self.next_validation {
                self.validate()?;
            }
            self.land(Upload::has_ended)?;
            if self.upload.is_none() && self.is_time_to_save() {
                self.save_beside()?;
            }
        }
        Ok(())
    }

    /// Whether the current step is validated.
    fn is_validated(&self) -> bool {
        self.validated == Some(self.trainer.progress().step)
    }

    /// Whether a checkpoint is due, or may come early because the current step is validated, which is most of its cost.
    fn is_time_to_save(&self) -> bool {
        let now = Instant::now();
        self.rhythm.is_due(now) || self.is_validated() && self.rhythm.is_near(now)
    }

    /// Saves, and continues while the files are copied. A fault is logged: the next checkpoint may reach
    /// the store.
    fn save_beside(&mut self) -> Result<(), JobFailure> {
        let began = Instant::now();
        let was_validated = self.is_validated();
        // The best checkpoint is chosen by its own PSNR.
        if !self.rhythm.is_first() && !was_validated {
            self.validate()?;
        }
        self.report("saving");
        let upload = self
            .save()
            .and_then(|(folder, saved)| Upload::start(self.context, folder, saved));
        match upload {
            Ok(upload) => self.upload = Some(upload),
            Err(failure) => self.not_written(&failure),
        }
        self.outlook.saved(began.elapsed());
        // The next checkpoint may need a validation of its own.
        let validating = if was_validated {
            self.outlook.validation()
        } else {
            Duration::ZERO
        };
        self.rhythm
            .saved(Instant::now(), began.elapsed() + validating);
        self.report("training");
        Ok(())
    }

    /// Takes note of an upload that has `ended`. A fault is logged, but for a lost lease.
    fn land(&mut self, ended: impl Fn(&Upload) -> bool) -> Result<(), JobFailure> {
        let Some(upload) = self.upload.take_if(|upload| ended(upload)) else {
            return Ok(());
        };
        match upload.wait() {
            Ok(published) => self.note(published),
            Err(JobFailure::LeaseLost) => return Err(JobFailure::LeaseLost),
            Err(failure) => self.not_written(&failure),
        }
        Ok(())
    }

    fn not_written(&self, failure: &JobFailure) {
        let job = &self.context.claim.job;
        tracing::warn!(job, ?failure, "a checkpoint could not be written");
    }

    fn note(&mut self, (step, bytes): (u64, u64)) {
        self.published = Some((step, bytes));
        let job = &self.context.claim.job;
        tracing::info!(job, step, bytes, "checkpoint published");
    }

    /// Measures again, publishes the best state as the last checkpoint, and returns the result.
    pub(super) fn finish(mut self) -> Result<TrainResult, JobFailure> {
        self.validate()?;
        let control = &self.context.control;
        self.trainer
            .keep_best(&mut || control.sign())
            .map_err(|error| failure("returning to the best state", &error))?;
        self.save_in_the_end()?;
        let progress = self.trainer.progress();
        let (seconds, steps) = self.spent();
        let (step, bytes) = self.published.unwrap_or((progress.step, 0));
        let guessed = self.trainer.guessed();
        Ok(TrainResult {
            guessed: guessed.map_err(|error| failure("reading what is guessed", &error))?,
            psnr_mask_box: finite(progress.psnr_mask_box),
            psnr: finite(progress.psnr),
            held_out: progress.held_out,
            image_size: self.plan.image_size(),
            checkpoint: names::checkpoint(&self.plan.model.name, step),
            steps,
            train_seconds: seconds,
            parameters: self.trainer.parameters(),
            checkpoint_bytes: bytes,
            device: self.context.device.info.adapter.clone(),
            objective: progress.objective.into(),
            active_parts: progress.active_parts,
            notes: self.trainer.notes(),
            removed: Vec::new(),
        })
    }

    /// Publishes the end of the training. A full disk or an unreachable store costs no step: the trained
    /// model waits for them, here, for a while.
    fn save_in_the_end(&mut self) -> Result<(), JobFailure> {
        let mut backoff = Backoff::new(Duration::from_secs(1), LONGEST_PAUSE);
        let began = Instant::now();
        loop {
            let failure = match self.last_checkpoint() {
                Err(failure @ JobFailure::TryLater { .. }) if began.elapsed() < PATIENCE => failure,
                ended => return ended,
            };
            self.not_written(&failure);
            if let JobFailure::TryLater { message, .. } = &failure {
                self.report(&format!("waiting to save: {message}"));
            }
            self.context.wait(backoff.pause())?;
        }
    }

    /// Publishes a checkpoint of this step, unless there is one.
    pub(super) fn last_checkpoint(&mut self) -> Result<(), JobFailure> {
        self.land(|_| true)?;
        let step = self.trainer.progress().step;
        if self.published.is_some_and(|(newest, _)| newest == step) {
            return Ok(());
        }
        self.report("saving");
        let (folder, saved) = self.save()?;
        let bytes = publish(self.context, folder.path(), &saved)?;
        self.note((step, bytes));
        Ok(())
    }

    /// Writes the checkpoint of this step to this machine's disk.
    fn save(&mut self) -> Result<(TempDir, Saved), JobFailure> {
        let began = Instant::now();
        let progress = self.trainer.progress();
        let folder = self.context.folder().map_err(|error| local(&error))?;
        self.trainer
            .save(folder.path())
            .map_err(|error| JobFailure::machine("saving a checkpoint", &error))?;
        let is_measured = self.validated == Some(progress.step);
        if is_measured && !self.trainer.previews().is_empty() {
            let sheet = preview::sheet(self.trainer.previews())?;
            let written = std::fs::write(folder.path().join(files::PREVIEW), sheet);
            written.map_err(|error| local(&error))?;
        }
        let (job_seconds, job_steps) = self.spent();
        let saved = Saved {
            began,
            model: self.plan.model.name.clone(),
            step: progress.step,
            job_seconds,
            job_steps,
            // An interrupted training has no time to measure.
            psnr: finite(progress.psnr).filter(|_| is_measured),
            slots: self.trainer.known_slots().map(|slot| slot as u32).collect(),
            image_size: self.plan.image_size(),
            shards: self.plan.shards.clone(),
        };
        Ok((folder, saved))
    }

    fn validate(&mut self) -> Result<(), JobFailure> {
        self.report("evaluating");
        let began = Instant::now();
        let control = &self.context.control;
        self.trainer
            .validate_with(&mut || control.sign())
            .map_err(|error| failure("evaluating held-out frames", &error))?;
        self.outlook.validated(began.elapsed());
        self.validated = Some(self.trainer.progress().step);
        self.next_validation = validation_after(self.trainer.progress().fraction);
        self.report("training");
        Ok(())
    }

    /// Seconds and steps of this job, over all its leases.
    fn spent(&self) -> (f64, u64) {
        let progress = self.trainer.progress();
        let seconds = (progress.train_seconds - self.began.0).max(0.0);
        let steps = progress.step.saturating_sub(self.began.1);
        (self.used.0 + seconds, self.used.1 + steps)
    }

    fn report(&mut self, phase: &str) {
        let now = self.trainer.progress();
        let left = (self.outlook).seconds_left(&now, self.rhythm.every());
        let (began, before) = self.since;
        let fraction = self.outlook.share(before, began, left);
        self.context.report(Progress {
            phase: phase.into(),
            step: now.step,
            total_steps: now.total_steps,
            fraction,
            steps_per_second: now.steps_per_second,
            loss: Some(now.loss),
            psnr: now.psnr,
            ssim: now.ssim,
            seconds_left: (left > 0.0).then_some(left),
            skipped_steps: now.skipped_steps,
            rollbacks: now.rollbacks,
            live_fraction: now.live_fraction,
            objective: now.objective.into(),
            device: String::new(),
            train_seconds: self.spent().0,
            active_parts: now.active_parts,
            checkpoint_step: self.published.map_or(0, |(step, _)| step),
        });
    }
}

/// A figure for the catalogue: two equal pictures have an infinite PSNR, which it rejects.
fn finite(psnr: Option<f64>) -> Option<f64> {
    psnr.filter(|psnr| psnr.is_finite())
}

/// The share of the budget at which the next validation is due.
fn validation_after(fraction: f64) -> f64 {
    ((fraction * VALIDATIONS).floor() + 1.0) / VALIDATIONS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eight_validations_fit_a_budget() {
        assert_eq!(validation_after(0.0), 0.125);
        assert_eq!(validation_after(0.13), 0.25);
        assert_eq!(validation_after(0.99), 1.0);
        assert!(validation_after(1.0) > 1.0, "the last one is in finish");
    }
}
