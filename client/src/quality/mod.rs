//! How good the model gets on given captures: trains in this process, without a service,
//! and measures on pictures that training never saw.
//!
//! This is the yardstick of the model's quality, so it is kept plain: the same captures,
//! size, seconds and seed give comparable figures from one version to the next.

mod captures;
mod evaluate;

use crate::progress::ProgressDisplay;
use crate::report::{Curve, CurvePoint, Report, Settings, SplitScores, SubjectScore};
use anyhow::{Context, ensure};
use captures::{Recording, Split};
use evaluate::Examiner;
use std::path::PathBuf;
use std::sync::Arc;
use yoto_avatar::config::ModelConfig;
use yoto_avatar::train::{Budget, Person, TrainOptions, TrainProgress, Trainer};
use yoto_proto::v1::Progress;

/// Measurements over the budget.
const CURVE_POINTS: f64 = 10.0;

/// What to train on, and how.
#[derive(Debug, Clone)]
pub struct QualityOptions {
    /// Capture folders, one a person.
    pub captures: Vec<PathBuf>,
    /// Longest side of the pictures, pixels.
    pub size: u32,
    /// Seconds of training.
    pub seconds: f64,
    /// Quality tier.
    pub tier: String,
    /// Model variant.
    pub variant: String,
    /// Seed of everything random.
    pub seed: u64,
    /// Where to write truth and render of each held-out picture side by side.
    pub pictures: Option<PathBuf>,
}

/// Trains and measures.
///
/// # Errors
/// At the first thing that fails, saying what: a capture that can't be read, a tier or
/// variant that nobody knows, training that diverges.
pub fn run(options: &QualityOptions) -> anyhow::Result<Report> {
    let config = ModelConfig::named(&options.tier, &options.variant)?;
    let recordings = captures::read_all(&options.captures, options.size)?;
    let picked = yoto_worker::pick();
    eprintln!("computing on {}", picked.info.adapter);
    if let Some(hint) = yoto_worker::hint_without_gpu_support() {
        eprintln!("{hint}");
    }
    let person = |(slot, recording): (usize, &Recording)| Person {
        slot,
        name: recording.name.clone(),
        shard: Arc::clone(&recording.shard),
    };
    let people = recordings.iter().enumerate().map(person).collect();
    let train_options = TrainOptions {
        budget: Budget::Seconds(options.seconds),
        used_seconds: 0.0,
        used_steps: 0,
        seed: options.seed,
        image_size: options.size,
        // Held-out views and poses stand beside the training frames, so all of these train.
        holdout_every: 0,
    };
    let mut trainer = Trainer::new(config, train_options, people, &picked.device)?;
    let curve = train(&mut trainer, &recordings)?;
    finish(options, &trainer, &recordings, curve, picked.info.adapter)
}

/// Trains until the budget is used up, measuring in between.
fn train(trainer: &mut Trainer, recordings: &[Recording]) -> anyhow::Result<Curve> {
    let mut curve = Curve {
        pictures_per_capture: captures::SUBSET,
        ..Curve::default()
    };
    let mut display = ProgressDisplay::new("training");
    let mut next_point = 1.0 / CURVE_POINTS;
    while !trainer.finished() {
        trainer.step().context("a training step")?;
        let progress = trainer.progress();
        let psnr = curve.novel_view.last().map(|point| point.psnr);
        display.progress(&shown(&progress, "training", psnr));
        if progress.fraction >= next_point || trainer.finished() {
            display.progress(&shown(&progress, "evaluating", psnr));
            let examiner = Examiner::new(trainer.renderer(), recordings);
            let point = |split| -> anyhow::Result<CurvePoint> {
                let score = examiner.subset(split)?;
                Ok(CurvePoint {
                    seconds: progress.train_seconds,
                    step: progress.step,
                    psnr: score.psnr,
                    psnr_mask_box: score.psnr_mask_box,
                    ssim: score.ssim,
                })
            };
            curve.novel_view.push(point(Split::NovelView)?);
            curve.novel_pose.push(point(Split::NovelPose)?);
            next_point = ((progress.fraction * CURVE_POINTS).floor() + 1.0) / CURVE_POINTS;
        }
    }
    let steps = trainer.progress().step;
    display.finish(&format!("{steps} steps"));
    Ok(curve)
}

/// Measures on every held-out picture.
fn finish(
    options: &QualityOptions,
    trainer: &Trainer,
    recordings: &[Recording],
    curve: Curve,
    device: String,
) -> anyhow::Result<Report> {
    let examiner = Examiner::new(trainer.renderer(), recordings);
    let mut display = ProgressDisplay::new("evaluating");
    let total: usize = recordings
        .iter()
        .map(|it| it.novel_view.len() + it.novel_pose.len())
        .sum();
    let (mut done, mut seconds, mut subjects) = (0, 0.0, Vec::new());
    for (slot, recording) in recordings.iter().enumerate() {
        let mut examine = |split| {
            let pictures = options.pictures.as_deref();
            examiner.all(slot, split, pictures, |spent| {
                done += 1;
                seconds += spent;
                display.progress(&Progress {
                    phase: format!("{}, picture {done} of {total}", recording.name),
                    fraction: done as f64 / total as f64,
                    ..Progress::default()
                });
            })
        };
        let (novel_view, novel_pose) = (examine(Split::NovelView)?, examine(Split::NovelPose)?);
        subjects.push(SubjectScore {
            name: recording.name.clone(),
            scores: SplitScores {
                novel_view,
                novel_pose,
            },
            black_image_psnr: novel_view.black_psnr,
        });
    }
    display.finish(&format!("{done} held-out pictures"));
    let progress = trainer.progress();
    Ok(Report {
        mean: SplitScores::mean(&subjects),
        subjects,
        steps: progress.step,
        train_seconds: progress.train_seconds,
        steps_per_second: progress.step as f64 / progress.train_seconds.max(f64::EPSILON),
        parameters: trainer.parameters(),
        checkpoint_bytes: checkpoint_bytes(trainer)?,
        device,
        render_seconds_per_frame: seconds / done.max(1) as f64,
        settings: Settings {
            tier: options.tier.clone(),
            variant: options.variant.clone(),
            size: options.size,
            seed: options.seed,
        },
        curve: Some(curve),
    })
}

/// What the model takes on disk, by writing it.
fn checkpoint_bytes(trainer: &Trainer) -> anyhow::Result<u64> {
    let folder = tempfile::tempdir().context("making a temporary folder")?;
    trainer.save(folder.path()).context("saving a checkpoint")?;
    let mut bytes = 0;
    for entry in std::fs::read_dir(folder.path()).context("reading the checkpoint's folder")? {
        bytes += entry
            .and_then(|entry| entry.metadata())
            .context("measuring the checkpoint")?
            .len();
    }
    ensure!(bytes > 0, "the checkpoint is empty");
    Ok(bytes)
}

/// The trainer's progress in the terms of the display.
fn shown(progress: &TrainProgress, phase: &str, psnr: Option<f64>) -> Progress {
    Progress {
        phase: phase.to_owned(),
        step: progress.step,
        fraction: progress.fraction,
        steps_per_second: progress.steps_per_second,
        loss: progress.loss,
        psnr,
        seconds_left: progress.seconds_left,
        skipped_steps: progress.skipped_steps,
        ..Progress::default()
    }
}
