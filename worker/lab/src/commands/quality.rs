//! `yoto-lab quality`: quality of a model on given captures, without a service.

use super::args;
use super::screen::Terminal;
use crate::captures::CaptureSource;
use crate::one_camera::{HeldOut, OneCamera};
use crate::quality::{QualityOptions, run};
use anyhow::Context;
use clap::Args;
use std::path::{Path, PathBuf};
use yoto_avatar::config::{LearnExposure, Refine, Setting};
use yoto_avatar::decoder::Prior;
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_avatar::train::Budget;
use yoto_capture::CaptureFolder;
use yoto_import::FfmpegArg;
use yoto_terminal::args::LpipsArgs;
use yoto_terminal::output;
use yoto_terminal::progress::ProgressDisplay;

const AFTER_HELP: &str = "\
Trains one model on all the captures and measures it on held-out pictures. Evaluation time does
not count as training.

A capture of one camera is a folder or an archive as `yoto subject add` takes it, video or
pictures. One frame in 20 (--hold-out) is not trained on, and is measured as a held-out pose.

A capture with pictures from other cameras or of other poses is a folder with
  poses.json             with eval {camera: {K, E, frames}} and eval_pose {frames, cams}
  train/frames, train/masks
  eval/CAMERA/frames, eval/CAMERA/masks
  eval_pose/CAMERA/frames, eval_pose/CAMERA/masks
and is trained on all of train/.

Examples:
  yoto-lab quality --capture captures/me --out report.json
  yoto-lab quality --capture captures/me --refine-poses --fit-poses --out report.json
  yoto-lab quality --capture data/ada --capture data/bob --out report.json
  yoto-lab quality --capture data/ada --seconds 60 --size 96 --pictures out/pairs --out report.json";

/// Train on captures and measure quality on held-out views and poses.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(super) struct Quality {
    /// Capture; may be repeated, once per person.
    #[arg(long = "capture", value_name = "CAPTURE", required = true, num_args = 1..)]
    captures: Vec<PathBuf>,
    /// Hold out one in N frames of a capture without held-out pictures of its own.
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u32).range(2..))]
    hold_out: u32,
    /// Longest side of the pictures, pixels.
    #[arg(long, value_name = "PX", default_value_t = 128, value_parser = clap::value_parser!(u32).range(16..=4096))]
    size: u32,
    /// Seconds of training.
    #[arg(long, value_name = "S", default_value = "300", value_parser = args::seconds, conflicts_with = "steps")]
    seconds: f64,
    /// Steps of training, in place of seconds.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    steps: Option<u64>,
    /// Measure at most this many pictures of each capture, of views and of poses.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    measure: Option<u32>,
    /// Pictures of each capture, of views and of poses, that are measured ten times during training;
    /// 0: measure at the end only.
    #[arg(long, value_name = "N", default_value_t = 6)]
    curve_pictures: u32,
    /// Quality tier: a trade-off of speed and detail.
    #[arg(long, default_value = yoto_proto::tiers::DEFAULT_TIER, value_parser = args::tier, long_help = args::tier_help())]
    tier: String,
    /// Model variant of the paper's ablation.
    #[arg(long, default_value = "yoto", value_parser = args::variant, long_help = args::variant_help())]
    variant: String,
    /// Another value for a setting of the tier, such as march.epsilon=1e-3; may be repeated.
    #[arg(long = "set", value_name = "NAME=VALUE")]
    settings: Vec<Setting>,
    /// Train on the poses of this file in each capture's folder, such as poses_noisy.json, and
    /// measure with those of poses.json.
    #[arg(long, value_name = "FILE")]
    train_poses: Option<String>,
    /// Refine the poses of the training frames: always, never, or auto, for people whose bodies
    /// wander off their masks or jump; with splats, auto makes small corrections to all other poses [default: by the
    /// tier: auto, or never for the tiers of the paper].
    #[arg(long, value_parser = args::refine_poses, value_name = "WHEN", num_args = 0..=1, default_missing_value = "always", require_equals = true)]
    refine_poses: Option<Refine>,
    /// Learn a gain and an offset of each training frame and colour channel: always, never, or auto, for films whose
    /// frames are exposed differently [default: by the tier: auto for splat, else never].
    #[arg(long, value_parser = args::exposure, value_name = "WHEN")]
    exposure: Option<LearnExposure>,
    /// Also measure after a fit of the held-out pictures' poses, with the model as it is.
    #[arg(long)]
    fit_poses: bool,
    /// Random seed.
    #[arg(long, default_value_t = 7)]
    seed: u64,
    /// File for the report.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Also write each held-out picture beside its render: truth, render, and a map of their
    /// difference, white from a quarter of the data range.
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
    /// What people look like where no frame shows them: people, the decoder that the program has; none; or the file of a
    /// decoder (`yoto-lab decoder`).
    #[arg(long, default_value = "people", value_name = "DECODER", value_parser = args::prior)]
    init: Prior,
    /// Join this trained model (a folder that --save wrote) in place of training a new one. The person of the one capture
    /// learns; nobody else changes, and tier, variant and settings are the model's.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["tier", "variant", "settings"])]
    join: Option<PathBuf>,
    /// Also write the trained model, for `yoto-lab evaluate` and `yoto export`.
    #[arg(long, value_name = "DIR")]
    save: Option<PathBuf>,
    #[command(flatten)]
    ffmpeg: FfmpegArg,
    #[command(flatten)]
    lpips: LpipsArgs,
}

impl Quality {
    pub(super) fn run(self) -> anyhow::Result<()> {
        let sources = self
            .captures
            .iter()
            .map(|path| capture_source(path, self.ffmpeg.program()));
        let options = QualityOptions {
            captures: sources.collect::<anyhow::Result<_>>()?,
            held_out: HeldOut::Every(self.hold_out as usize),
            size: self.size,
            budget: match self.steps {
                Some(steps) => Budget::Steps(steps),
                None => Budget::Seconds(self.seconds),
            },
            measured: self.measure.map_or(usize::MAX, |count| count as usize),
            settings: self.settings,
            curve_pictures: self.curve_pictures as usize,
            tier: self.tier,
            variant: self.variant,
            train_poses: self.train_poses,
            refine_poses: self.refine_poses,
            exposure: self.exposure,
            fit_poses: self.fit_poses,
            seed: self.seed,
            pictures: self.pictures,
            join: self.join,
            save: self.save,
            prior: self.init,
            lpips: self.lpips.weights(LpipsWeights::both)?,
        };
        let report = run(&options, &Terminal)?;
        report
            .write(&self.out)
            .with_context(|| format!("writing {}", self.out.display()))?;
        say!("{}", report.table());
        say!("report: {}", self.out.display());
        output::put("files", output::paths(&[&self.out]));
        Ok(())
    }
}

/// The capture at `path`, read whole if it has no held-out pictures.
pub(super) fn capture_source(path: &Path, ffmpeg: Option<&Path>) -> anyhow::Result<CaptureSource> {
    let read = || -> anyhow::Result<CaptureSource> {
        if CaptureFolder::has_held_out(path)? {
            return Ok(CaptureSource::Studio(path.to_owned()));
        }
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let mut display = ProgressDisplay::new(&*name);
        let capture = OneCamera::read(path, ffmpeg, |done, frames| {
            display.count("frame", done, frames);
        })?;
        display.clear();
        Ok(CaptureSource::OneCamera(path.to_owned(), capture))
    };
    read().with_context(|| format!("the capture {}", path.display()))
}
