//! How good the model gets on given captures: trains in this process, without a service,
//! and measures on pictures that training never saw.
//!
//! This is the yardstick of the model's quality, so it is kept plain: the same captures,
//! size, seconds and seed give comparable figures from one version to the next.

pub mod ablation;
mod captures;
mod measure;
pub mod model_dir;
pub mod tradeoff;

use crate::progress::ProgressDisplay;
use crate::report::{Curve, CurvePoint, Report, Settings, SplitScores, SubjectScore};
use anyhow::{Context, ensure};
use captures::{Recording, Split, View};
use std::path::PathBuf;
use yoto_avatar::config::{ModelConfig, Setting, Sharing};
use yoto_avatar::evaluate::{Examiner, LpipsMetric, Protocol};
use yoto_avatar::train::{Budget, TrainOptions, TrainProgress, Trainer};
use yoto_proto::protocols::HELD_OUT;
use yoto_proto::v1::Progress;
use yoto_worker::PickedDevice;

/// Measurements over the budget.
const CURVE_POINTS: f64 = 10.0;
/// Pictures of each capture and split that a point of the curve is measured on. All of
/// them would take longer than the training between two points.
const CURVE_PICTURES: usize = 6;

/// What to train on, and how.
#[derive(Debug, Clone)]
pub struct QualityOptions {
    /// Capture folders, one a person.
    pub captures: Vec<PathBuf>,
    /// Longest side of the pictures, pixels.
    pub size: u32,
    /// How long to train.
    pub budget: Budget,
    /// Held-out pictures of each capture and split that are measured at the end, at most.
    pub measured: usize,
    /// Quality tier.
    pub tier: String,
    /// Model variant.
    pub variant: String,
    /// What people share of the hash grid, in place of what the tier says.
    pub sharing: Option<Sharing>,
    /// In place of what the tier says, too.
    pub settings: Vec<Setting>,
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
    let mut config = ModelConfig::named(&options.tier, &options.variant)?;
    if let Some(sharing) = options.sharing {
        config = config.shared(sharing)?;
    }
    config = config.with(&options.settings)?;
    let protocol = Protocol::named(HELD_OUT)?;
    let recordings = captures::read_all(&options.captures, options.size, protocol)?;
    let picked = pick_device();
    let people = recordings.iter().enumerate();
    let people = people.map(|(slot, recording)| recording.person(slot));
    let train_options = train_options(options.budget, options.size, options.seed);
    let mut trainer = Trainer::new(config, train_options, people.collect(), &picked.device)?;
    let curve = train(&mut trainer, &recordings, protocol)?;
    finish(options, &trainer, &recordings, protocol, curve, &picked)
}

/// What to compute on, told to whoever watches.
fn pick_device() -> PickedDevice {
    let picked = yoto_worker::pick();
    eprintln!("computing on {}", picked.info.adapter);
    if let Some(hint) = yoto_worker::hint_on_cpu() {
        eprintln!("{hint}");
    }
    picked
}

/// The networks of LPIPS, where the environment names their weights.
fn lpips(picked: &PickedDevice) -> anyhow::Result<Option<LpipsMetric>> {
    LpipsMetric::from_environment(&picked.device).context("loading the weights of LPIPS")
}

/// Held-out views and poses stand beside the training frames, so all of these train.
fn train_options(budget: Budget, image_size: u32, seed: u64) -> TrainOptions {
    TrainOptions {
        budget,
        used_seconds: 0.0,
        used_steps: 0,
        seed,
        image_size,
        holdout_every: 0,
    }
}

/// Trains until the budget is used up, measuring in between.
fn train(
    trainer: &mut Trainer,
    recordings: &[Recording],
    protocol: &'static Protocol,
) -> anyhow::Result<Curve> {
    let mut curve = Curve {
        pictures_per_capture: CURVE_PICTURES,
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
            let examiner = Examiner::new(trainer.renderer(), protocol, None);
            let point = |split| -> anyhow::Result<CurvePoint> {
                let score = measure::subset(&examiner, recordings, split, CURVE_PICTURES)?;
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
    protocol: &'static Protocol,
    curve: Curve,
    picked: &PickedDevice,
) -> anyhow::Result<Report> {
    let examiner = Examiner::new(trainer.renderer(), protocol, lpips(picked)?);
    let mut display = ProgressDisplay::new("evaluating");
    let measured = |pictures: &[View]| pictures.len().min(options.measured);
    let total: usize = recordings
        .iter()
        .map(|it| measured(&it.novel_view) + measured(&it.novel_pose))
        .sum();
    let (mut done, mut seconds, mut subjects) = (0, 0.0, Vec::new());
    for (slot, recording) in recordings.iter().enumerate() {
        let mut examine = |split| {
            measure::person(
                &examiner,
                slot,
                recording,
                split,
                options.measured,
                |view, examined| {
                    if let Some(folder) = &options.pictures {
                        measure::write_pair(folder, recording, split, view, examined)?;
                    }
                    done += 1;
                    seconds += examined.seconds;
                    display.progress(&Progress {
                        phase: format!("{}, picture {done} of {total}", recording.name),
                        fraction: done as f64 / total as f64,
                        ..Progress::default()
                    });
                    Ok(())
                },
            )
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
        person_bytes: Some(4 * trainer.parameters_of_a_person()),
        device: picked.info.adapter.clone(),
        objective: progress.objective.into(),
        render_seconds_per_frame: seconds / done.max(1) as f64,
        settings: Settings {
            tier: options.tier.clone(),
            variant: options.variant.clone(),
            size: options.size,
            seed: options.seed,
            sharing: options.sharing.map(|sharing| sharing.to_string()),
            changed: options.settings.iter().map(Setting::to_string).collect(),
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
