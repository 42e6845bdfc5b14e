//! `yoto-lab tradeoff`: quality over time, in training and in rendering.

use super::args;
use super::screen::Terminal;
use crate::tradeoff::{TradeoffOptions, run};
use anyhow::ensure;
use clap::Args;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_terminal::args::LpipsArgs;
use yoto_terminal::output;

const AFTER_HELP: &str = "\
Trains every tier with every budget, measures each on held-out views and poses, and sweeps over
render settings of the longest trained model of each tier. `yoto-lab quality --help` shows the
layout of captures.

OUT holds tradeoff.json and tradeoff.csv.

Example:
  yoto-lab tradeoff --capture data/ada data/bob --tiers draft,fast --budgets 30,60,120 --out out/t";

/// Measure quality over training time, and over render time.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(super) struct TradeoffCommand {
    /// Capture folder; may be repeated, once per person.
    #[arg(long = "capture", value_name = "DIR", num_args = 1.., required = true)]
    captures: Vec<PathBuf>,
    /// Quality tiers to train, separated by commas.
    #[arg(
        long,
        value_name = "A,B,…",
        value_delimiter = ',',
        default_value = "fast,splat",
        value_parser = args::tier
    )]
    tiers: Vec<String>,
    /// Seconds of training, separated by commas; each is a separate training.
    #[arg(
        long,
        value_name = "S,S,…",
        value_delimiter = ',',
        default_value = "30,60,120",
        value_parser = args::seconds
    )]
    budgets: Vec<f64>,
    /// Longest side of the pictures, pixels.
    #[arg(long, value_name = "PX", default_value_t = 128, value_parser = clap::value_parser!(u32).range(16..=4096))]
    size: u32,
    /// Random seed.
    #[arg(long, default_value_t = 7)]
    seed: u64,
    /// Measure at most this many held-out pictures of each kind and person [default: all].
    #[arg(long = "measure", alias = "pictures", value_name = "N")]
    pictures: Option<NonZeroUsize>,
    /// Held-out frames to render with each setting.
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=64))]
    views: u32,
    /// Timed renders of each frame and setting, of which the median is used.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=32))]
    repeats: u32,
    /// Folder for the files.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Write over files that are there already.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    lpips: LpipsArgs,
}

impl TradeoffCommand {
    pub(super) fn run(self) -> anyhow::Result<()> {
        let taken = self.out.join("tradeoff.json");
        ensure!(
            self.force || !taken.exists(),
            "{} is there already: choose another folder (--out), or write over it (--force)",
            taken.display()
        );
        let mut budgets = self.budgets;
        budgets.sort_by(f64::total_cmp);
        let options = TradeoffOptions {
            captures: self.captures,
            size: self.size,
            tiers: self.tiers,
            budgets,
            seed: self.seed,
            pictures: self.pictures.map_or(usize::MAX, NonZeroUsize::get),
            views: self.views as usize,
            repeats: self.repeats as usize,
            lpips: self.lpips.weights(LpipsWeights::both)?,
        };
        let tradeoff = run(&options, &Terminal)?;
        let paths = tradeoff.write(&self.out)?;
        say!("{}", tradeoff.summary());
        output::put("tradeoff", serde_json::to_value(&tradeoff)?);
        output::put("files", output::paths(&paths));
        for path in paths {
            say!("{}", path.display());
        }
        Ok(())
    }
}
