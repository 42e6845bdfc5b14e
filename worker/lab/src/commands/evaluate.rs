//! `yoto-lab evaluate`: quality of a model in a folder, on held-out pictures of captures.

use super::args;
use super::screen::Terminal;
use crate::model_dir::{ModelDirOptions, run};
use clap::Args;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use yoto_avatar::evaluate::{Row, paper_table};
use yoto_avatar::loss::lpips::LpipsWeights;
use yoto_proto::protocols::HELD_OUT;
use yoto_terminal::args::LpipsArgs;
use yoto_terminal::output;
use yoto_terminal::scores::{scores_json, scores_table};

const AFTER_HELP: &str = "\
Measures on a capture folder's eval/ (other cameras) and eval_pose/ (other poses); `yoto-lab quality
--help` shows the layout.

Example:
  yoto-lab evaluate --model-dir out/models/yoto --capture data/ada --capture data/bob --table";

/// Measure a trained model on held-out pictures.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(super) struct Evaluate {
    /// Folder of a trained model (weights and state).
    #[arg(long, value_name = "DIR")]
    model_dir: PathBuf,
    /// Capture folder with held-out pictures; one for each of the model's slots, in order.
    #[arg(long = "capture", value_name = "DIR", num_args = 1.., required = true)]
    captures: Vec<PathBuf>,
    /// Pictures to compare, and the method.
    #[arg(long, default_value = HELD_OUT, value_parser = args::protocol, long_help = args::protocol_help())]
    protocol: String,
    /// Longest side of compared pictures, pixels [default: the captures' size].
    #[arg(long, value_name = "PX", default_value_t = 0, hide_default_value = true, value_parser = args::compared_size)]
    size: u32,
    /// Measure at most this many pictures of each kind and person [default: all].
    #[arg(long = "measure", alias = "pictures", value_name = "N")]
    pictures: Option<NonZeroUsize>,
    /// Also print the paper's table with these figures.
    #[arg(long)]
    table: bool,
    #[command(flatten)]
    lpips: LpipsArgs,
}

impl Evaluate {
    pub(super) fn run(self) -> anyhow::Result<()> {
        let options = ModelDirOptions {
            model_dir: self.model_dir,
            captures: self.captures,
            protocol: self.protocol,
            size: self.size,
            pictures: self.pictures.map_or(usize::MAX, NonZeroUsize::get),
            lpips: self.lpips.weights(LpipsWeights::both)?,
        };
        let measured = run(&options, &Terminal)?;
        output::put("scores", scores_json(&measured.rows));
        say!("step {} by {}\n", measured.step, measured.protocol);
        say!("{}", scores_table(&measured.rows));
        if self.table {
            let row = Row {
                variant: measured.variant,
                scores: measured.means,
            };
            say!("\n{}", paper_table(&measured.headings, &[row]));
        }
        Ok(())
    }
}
