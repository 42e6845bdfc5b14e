//! Quality of a model on given captures: trains in this process, without a service, and measures
//! on held-out pictures.
//!
//! This is the reference measurement of the model's quality: the same captures, size, seconds and
//! seed give comparable figures between versions.

use crate::alignment::Alignment;
use crate::captures::{self, CaptureSource, HeldOutPicture, Recording, Split};
use crate::display::Screen;
use crate::one_camera::HeldOut;
use crate::pose_error::PoseErrors;
use crate::report::{Curve, CurvePoint, QualityReport, Settings};
use crate::split_regions::SplitRegions;
use crate::training::{self, checkpoint_bytes, lpips, pick_device, shown};
use crate::{limits, measure, other_poses};
use anyhow::{Context, ensure};
use std::path::{Path, PathBuf};
use yoto_avatar::config::{LearnExposure, ModelConfig, Refine, Setting};
use yoto_avatar::decoder::Prior;
use yoto_avatar::evaluate::{Examiner, Protocol, RegionSums, SplitScores, SubjectScore};
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_avatar::train::{Budget, Learn, ModelState, TrainOptions, Trainer};
use yoto_device::PickedDevice;
use yoto_proto::protocols::HELD_OUT;
use yoto_proto::v1::Progress;

/// Measurements over the budget.
const CURVE_POINTS: f64 = 10.0;

/// Settings of a measurement.
#[derive(Debug, Clone)]
pub struct QualityOptions {
    /// Captures, one per person.
    pub captures: Vec<CaptureSource>,
    /// The frames of a capture of one camera that are held out.
    pub held_out: HeldOut,
    /// Longest side of the pictures, pixels.
    pub size: u32,
    /// Training budget.
    pub budget: Budget,
    /// Most held-out pictures of each capture and split to measure at the end.
    pub measured: usize,
    /// Pictures of each capture and split for a point of quality over time; 0: no such points.
    pub curve_pictures: usize,
    /// Quality tier.
    pub tier: String,
    /// Model variant.
    pub variant: String,
    /// Other settings in place of the tier's.
    pub settings: Vec<Setting>,
    /// File in each capture's folder with other poses for its training frames.
    pub train_poses: Option<String>,
    /// When the poses of training frames are refined, in place of the tier's choice.
    pub refine_poses: Option<Refine>,
    /// When exposures are learned, in place of the tier's choice.
    pub exposure: Option<LearnExposure>,
    /// Whether held-out pictures are also measured after a fit of their poses alone.
    pub fit_poses: bool,
    /// Random seed.
    pub seed: u64,
    /// Folder for truth and render of each held-out picture side by side.
    pub pictures: Option<PathBuf>,
    /// Knowledge of people before the training.
    pub prior: Prior,
    /// Checkpoint of a model that the person of the one capture joins, in place of a new model.
    pub join: Option<PathBuf>,
    /// Folder for the trained model.
    pub save: Option<PathBuf>,
    /// Weights of the networks of LPIPS; without them LPIPS is neither measured nor minimised.
    pub lpips: Option<LpipsWeights>,
}

/// Trains and measures.
///
/// # Errors
/// The first failure: a capture that can't be read, an unknown tier or variant, training that
/// diverges.
pub fn run(options: &QualityOptions, screen: &dyn Screen) -> anyhow::Result<QualityReport> {
    let mut config = ModelConfig::named(&options.tier, &options.variant)?;
    config = config.with(&options.settings)?;
    let protocol = Protocol::named(HELD_OUT)?;
    let mut recordings = captures::read_sources(
        &options.captures,
        options.size,
        options.held_out,
        protocol,
        screen,
    )?;
    if let Some(file) = &options.train_poses {
        captures::train_on_poses_of(file, &options.captures, &mut recordings)?;
    }
    let picked = pick_device(screen);
    let first_slot = match &options.join {
        Some(dir) => first_free_slot(dir, &recordings)?,
        None => 0,
    };
    let people = (first_slot..).zip(&recordings);
    let people = people.map(|(slot, recording)| recording.person(slot));
    let train_options = TrainOptions {
        refine_poses: options.refine_poses,
        exposure: options.exposure,
        prior: options.prior.clone(),
        learn: match options.join {
            Some(_) => Learn::Own { slot: first_slot },
            None => Learn::Everything,
        },
        ..training::options(
            options.budget,
            options.size,
            options.seed,
            options.lpips.as_ref(),
        )
    };
    let people = people.collect();
    let mut trainer = match &options.join {
        Some(dir) => Trainer::resume(dir, train_options, people, &picked.device)
            .with_context(|| format!("joining the model {}", dir.display()))?,
        None => Trainer::new(config, train_options, people, &picked.device)?,
    };
    let curve = train(
        &mut trainer,
        &mut recordings,
        first_slot,
        protocol,
        options.curve_pictures,
        screen,
    )?;
    if let Some(folder) = &options.save {
        let save = || -> anyhow::Result<()> {
            std::fs::create_dir_all(folder)?;
            Ok(trainer.save(folder)?)
        };
        save().with_context(|| format!("writing the model to {}", folder.display()))?;
    }
    follow(&mut recordings, first_slot, &trainer);
    finish(
        options,
        &trainer,
        &recordings,
        first_slot,
        curve,
        &picked,
        screen,
    )
}

/// The slot of somebody who joins the model in `dir`, who is the only one that trains.
fn first_free_slot(dir: &Path, recordings: &[Recording]) -> anyhow::Result<usize> {
    ensure!(
        recordings.len() == 1,
        "one capture can join a model at a time, and {} are given",
        recordings.len()
    );
    let state = ModelState::read(dir)
        .with_context(|| format!("the model {} (is it a checkpoint's folder?)", dir.display()))?;
    Ok(state.slots.len())
}

/// Sets poses and exposures of held-out frames of training films to those between their neighbours.
fn follow(recordings: &mut [Recording], first_slot: usize, trainer: &Trainer) {
    for (slot, recording) in (first_slot..).zip(recordings) {
        recording.follow(trainer, slot);
    }
}

/// Trains until the budget is used up, and measures ten times on the way.
fn train(
    trainer: &mut Trainer,
    recordings: &mut [Recording],
    first_slot: usize,
    protocol: &'static Protocol,
    pictures: usize,
    screen: &dyn Screen,
) -> anyhow::Result<Curve> {
    let mut curve = Curve {
        pictures_per_capture: pictures,
        ..Curve::default()
    };
    let mut display = screen.begin("training");
    let mut next_point = 1.0 / CURVE_POINTS;
    training::train(trainer, &mut *display, |trainer, display| {
        let progress = trainer.progress();
        let is_due = progress.fraction >= next_point || trainer.finished();
        if pictures > 0 && is_due {
            display.progress(&shown(&progress, "evaluating", curve.newest_psnr()));
            follow(recordings, first_slot, trainer);
            let examiner = Examiner::new(trainer.renderer(), protocol, None);
            let point = |split| -> anyhow::Result<Option<CurvePoint>> {
                let score = measure::subset(&examiner, recordings, first_slot, split, pictures)?;
                Ok((score.pictures > 0).then_some(CurvePoint {
                    seconds: progress.train_seconds,
                    step: progress.step,
                    psnr: score.psnr,
                    psnr_mask_box: score.psnr_mask_box,
                    ssim: score.ssim,
                }))
            };
            curve.novel_view.extend(point(Split::NovelView)?);
            curve.novel_pose.extend(point(Split::NovelPose)?);
            next_point = ((progress.fraction * CURVE_POINTS).floor() + 1.0) / CURVE_POINTS;
        }
        Ok(curve.newest_psnr())
    })?;
    let steps = trainer.progress().step;
    display.finish(&format!("{steps} steps"));
    Ok(curve)
}

/// Measures on every held-out picture.
fn finish(
    options: &QualityOptions,
    trainer: &Trainer,
    recordings: &[Recording],
    first_slot: usize,
    curve: Curve,
    picked: &PickedDevice,
    screen: &dyn Screen,
) -> anyhow::Result<QualityReport> {
    let protocol = Protocol::named(HELD_OUT)?;
    let examiner = Examiner::new(
        trainer.renderer(),
        protocol,
        lpips(options.lpips.as_ref(), picked)?,
    );
    let mut display = screen.begin("evaluating");
    let measured = |pictures: &[HeldOutPicture]| pictures.len().min(options.measured);
    let total: usize = recordings
        .iter()
        .map(|it| measured(&it.novel_view) + measured(&it.novel_pose))
        .sum();
    let (mut done, mut seconds, mut subjects) = (0, 0.0, Vec::new());
    let (mut views, mut poses) = (RegionSums::default(), RegionSums::default());
    for (slot, recording) in (first_slot..).zip(recordings) {
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
                    match split {
                        Split::NovelView => views.add(&examined.regions),
                        Split::NovelPose => poses.add(&examined.regions),
                    }
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
        let scores = SplitScores {
            novel_view,
            novel_pose,
        };
        subjects.push(SubjectScore {
            name: recording.name.clone(),
            scores,
            black_image_psnr: scores.black_psnr(),
        });
    }
    display.finish(&format!("{done} held-out pictures"));
    let fitted = options
        .fit_poses
        .then(|| {
            other_poses::fitted(
                trainer,
                &examiner,
                recordings,
                first_slot,
                options.measured,
                screen,
            )
        })
        .transpose()?;
    let alignments = (first_slot..).zip(recordings);
    let alignments = alignments.map(|(slot, it)| it.alignment(&trainer.refined_poses(slot)));
    let alignments: Vec<_> = alignments.collect::<anyhow::Result<_>>()?;
    let alignments: Option<Vec<Alignment>> = alignments.into_iter().collect();
    let aligned = alignments
        .map(|it| {
            let measured = options.measured;
            other_poses::aligned(&it, &examiner, recordings, first_slot, measured, screen)
        })
        .transpose()?;
    let errors = (first_slot..).zip(recordings);
    let errors = errors.map(|(slot, it)| it.pose_errors(&trainer.refined_poses(slot)));
    let errors: Vec<_> = errors.collect::<anyhow::Result<Vec<_>>>()?;
    let errors: Vec<PoseErrors> = errors.into_iter().flatten().collect();
    let mut all = views.clone();
    all.add(&poses);
    let all = all.errors();
    let limits = recordings.iter().map(|it| limits::limit(it, &all));
    let limits: Vec<String> = limits.collect::<Result<_, _>>()?;
    let progress = trainer.progress();
    Ok(QualityReport {
        mean: SplitScores::mean(&subjects),
        fitted,
        aligned,
        subjects,
        steps: progress.step,
        train_seconds: progress.train_seconds,
        steps_per_second: progress.step as f64 / progress.train_seconds.max(f64::EPSILON),
        // Splats are not sampled along rays.
        samples_per_ray: (progress.samples.rays > 0)
            .then(|| progress.samples.per_ray(progress.samples.evaluated)),
        parameters: trainer.parameters(),
        checkpoint_bytes: checkpoint_bytes(trainer)?,
        person_bytes: Some(4 * trainer.parameters_of_a_person()),
        device: picked.info.adapter.clone(),
        objective: progress.objective.into(),
        active_parts: progress.active_parts,
        notes: [trainer.notes(), limits].concat(),
        pose_errors: PoseErrors::mean(&errors),
        render_seconds_per_frame: seconds / done.max(1) as f64,
        settings: Settings {
            tier: options.tier.clone(),
            variant: options.variant.clone(),
            size: options.size,
            seed: options.seed,
            changed: options.settings.iter().map(Setting::to_string).collect(),
        },
        curve: (options.curve_pictures > 0).then_some(curve),
        regions: Some(SplitRegions {
            novel_view: views.errors(),
            novel_pose: poses.errors(),
        }),
    })
}
