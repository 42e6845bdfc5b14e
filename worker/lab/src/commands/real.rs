//! `yoto-lab real`: clips as people have them, through the whole path.

use super::screen::Terminal;
use super::{args, import_progress};
use crate::one_camera::HeldOut;
use crate::quality::QualityOptions;
use crate::real::{RealOptions, run, table};
use clap::Args;
use std::path::{Path, PathBuf};
use yoto_avatar::config::{LearnExposure, Refine, Setting};
use yoto_avatar::decoder::Prior;
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_avatar::train::Budget;
use yoto_import::{FfmpegArg, Options};
use yoto_terminal::args::LpipsArgs;
use yoto_terminal::output;

const AFTER_HELP: &str = "\
Finds poses and masks of each clip, checks them, trains a model of that person alone, and measures
on frames that were not trained on: one in ten, and three blocks that are a tenth of the clip. A clip
that can't be used has the reason in its row.

The folder --out has report.json, sheet.png with truth beside render, and for each clip its capture and
pictures. A capture in DIR is used as it is, so that a second run with --out/*/capture is faster.

Examples:
  yoto-lab real clips --pose-model models --out out/real
  yoto-lab real clips --pose-model models --seconds 60 --refine-poses=never --out out/never
  yoto-lab real captures/me --size 768 --set splats.count=40000 --out out/me";

/// Take real clips through the whole path and measure each on held-out frames.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(super) struct Real {
    /// A folder of clips and captures, or one of them.
    #[arg(value_name = "DIR")]
    source: PathBuf,
    /// Folder for results.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// The pose model: a file, or the folder that deploy/models/get.sh filled.
    #[arg(long, value_name = "PATH", env = "YOTO_POSE_MODEL")]
    pose_model: Option<PathBuf>,
    /// Longest side of the pictures, pixels.
    #[arg(long, value_name = "PX", default_value_t = 512, value_parser = clap::value_parser!(u32).range(16..=4096))]
    size: u32,
    /// Seconds of training of each clip.
    #[arg(long, value_name = "S", default_value = "120", value_parser = args::seconds, conflicts_with = "steps")]
    seconds: f64,
    /// Steps of training of each clip, in place of seconds.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    steps: Option<u64>,
    /// Measure at most this many held-out pictures of each kind per clip.
    #[arg(long, value_name = "N", default_value_t = 24, value_parser = clap::value_parser!(u32).range(1..))]
    measure: u32,
    /// Pictures of each kind that are measured ten times during training; 0: measure at the end only.
    #[arg(long, value_name = "N", default_value_t = 0)]
    curve_pictures: u32,
    /// Quality tier: a trade-off of speed and detail.
    #[arg(long, default_value = yoto_proto::tiers::DEFAULT_TIER, value_parser = args::tier, long_help = args::tier_help())]
    tier: String,
    /// Another value for a setting of the tier; may be repeated.
    #[arg(long = "set", value_name = "NAME=VALUE")]
    settings: Vec<Setting>,
    /// Refine the poses of the training frames: always, never, or auto [default: by the tier].
    #[arg(long, value_parser = args::refine_poses, value_name = "WHEN", num_args = 0..=1, default_missing_value = "always", require_equals = true)]
    refine_poses: Option<Refine>,
    /// Learn the exposure of each training frame: always, never, or auto [default: by the tier].
    #[arg(long, value_parser = args::exposure, value_name = "WHEN")]
    exposure: Option<LearnExposure>,
    /// Random seed.
    #[arg(long, value_name = "N", default_value_t = 7)]
    seed: u64,
    #[command(flatten)]
    ffmpeg: FfmpegArg,
    #[command(flatten)]
    lpips: LpipsArgs,
}

impl Real {
    pub(super) fn run(self) -> anyhow::Result<()> {
        let options = RealOptions {
            source: self.source,
            import: Options {
                pose_model: self.pose_model,
                ffmpeg: self.ffmpeg.program().map(Path::to_owned),
                progress: import_progress::on_terminal(),
                ..Options::default()
            },
            quality: QualityOptions {
                // Those of each clip take their place.
                captures: Vec::new(),
                held_out: HeldOut::Every(10),
                pictures: None,
                save: None,
                join: None,
                prior: Prior::People,
                size: self.size,
                budget: match self.steps {
                    Some(steps) => Budget::Steps(steps),
                    None => Budget::Seconds(self.seconds),
                },
                measured: self.measure as usize,
                curve_pictures: self.curve_pictures as usize,
                tier: self.tier,
                variant: "yoto".to_owned(),
                settings: self.settings,
                train_poses: None,
                refine_poses: self.refine_poses,
                exposure: self.exposure,
                fit_poses: true,
                seed: self.seed,
                lpips: self.lpips.weights(LpipsWeights::both)?,
            },
            out: self.out,
        };
        let clips = run(&options, &Terminal)?;
        say!("{}", table(&clips));
        let files = ["report.json", "sheet.png"].map(|name| options.out.join(name));
        output::put("files", output::paths(&files));
        files.iter().for_each(|file| say!("{}", file.display()));
        Ok(())
    }
}
