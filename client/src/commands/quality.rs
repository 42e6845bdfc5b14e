//! `yoto quality`: quality of a model on given captures, without a service.

use super::model::{tier_help, variant_help};
use super::table;
use crate::progress::Terminal;
use anyhow::Context;
use clap::Args;
use std::path::PathBuf;
use yoto_avatar::config::{Setting, Sharing};
use yoto_avatar::train::Budget;
use yoto_lab::quality::{QualityOptions, run};

const AFTER_HELP: &str = "\
Trains one model on all the captures and measures it on held-out pictures: held-out
cameras (eval/) and held-out poses (eval_pose/). Evaluation time does not count as training.

Layout of a capture folder:
  poses.json             with eval {camera: {K, E, frames}} and eval_pose {frames, cams}
  train/frames, train/masks
  eval/CAMERA/frames, eval/CAMERA/masks
  eval_pose/CAMERA/frames, eval_pose/CAMERA/masks

Examples:
  yoto quality --capture data/ada --capture data/bob --out report.json
  yoto quality --capture data/ada --seconds 60 --size 96 --pictures out/pairs --out report.json";

/// Train on capture folders and measure quality on held-out views and poses.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(super) struct Quality {
    /// Capture folder; may be repeated, once per person.
    #[arg(long = "capture", value_name = "DIR", required = true, num_args = 1..)]
    captures: Vec<PathBuf>,
    /// Longest side of the pictures, pixels.
    #[arg(long, value_name = "PX", default_value_t = 128, value_parser = clap::value_parser!(u32).range(16..=4096))]
    size: u32,
    /// Seconds of training.
    #[arg(long, value_name = "S", default_value = "300", value_parser = table::seconds, conflicts_with = "steps")]
    seconds: f64,
    /// Steps of training, in place of seconds.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    steps: Option<u64>,
    /// Measure at most this many pictures of each capture, of views and of poses.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    measure: Option<u32>,
    /// Quality tier: a trade-off of speed and detail.
    #[arg(long, default_value = "fast", value_parser = table::tier, long_help = tier_help())]
    tier: String,
    /// Model variant of the paper's ablation.
    #[arg(long, default_value = "yoto", value_parser = table::variant, long_help = variant_help())]
    variant: String,
    /// Sharing of the hash grid: own, split:ROWS (a shared table, and one per person with at most
    /// 2^ROWS rows per level) or bases:COUNT (shared rows that each person mixes) [default: the
    /// tier's].
    #[arg(long, value_name = "KIND")]
    sharing: Option<Sharing>,
    /// Another value for a setting of the tier, such as march.epsilon=1e-3; may be repeated.
    #[arg(long = "set", value_name = "NAME=VALUE")]
    settings: Vec<Setting>,
    /// Train on the poses of this file in each capture's folder, such as poses_noisy.json, and
    /// measure with those of poses.json.
    #[arg(long, value_name = "FILE")]
    train_poses: Option<String>,
    /// Refine the poses of the training frames: for poses that were estimated.
    #[arg(long)]
    refine_poses: bool,
    /// Also measure after a fit of the held-out pictures' poses, with the model as it is.
    #[arg(long)]
    fit_poses: bool,
    /// Random seed.
    #[arg(long, default_value_t = 7)]
    seed: u64,
    /// File for the report.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Also write each held-out picture beside its render: truth left, render right.
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
    #[command(flatten)]
    lpips: super::lpips_args::LpipsArgs,
}

impl Quality {
    pub(super) fn run(self) -> anyhow::Result<()> {
        let options = QualityOptions {
            captures: self.captures,
            size: self.size,
            budget: match self.steps {
                Some(steps) => Budget::Steps(steps),
                None => Budget::Seconds(self.seconds),
            },
            measured: self.measure.map_or(usize::MAX, |count| count as usize),
            sharing: self.sharing,
            settings: self.settings,
            tier: self.tier,
            variant: self.variant,
            train_poses: self.train_poses,
            refine_poses: self.refine_poses,
            fit_poses: self.fit_poses,
            seed: self.seed,
            pictures: self.pictures,
            lpips: self.lpips.weights()?,
        };
        let report = run(&options, &Terminal)?;
        report
            .write(&self.out)
            .with_context(|| format!("writing {}", self.out.display()))?;
        println!("{}", report.table());
        println!("report: {}", self.out.display());
        Ok(())
    }
}
