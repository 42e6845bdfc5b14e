//! `yoto evaluate`: quality of a trained model on held-out pictures.

use crate::args;
use crate::args::{QueueArgs, Server};
use crate::show;
use crate::show::{scores_json, scores_table};
use crate::waiting::wait_for_new;
use anyhow::Context;
use clap::Args;
#[cfg(feature = "embedded")]
use std::path::PathBuf;
use yoto_proto::names;
use yoto_proto::protocols::{HELD_OUT, PROTOCOLS};
use yoto_proto::v1::{EvaluateSpec, job_result};
use yoto_terminal::output;
use yoto_terminal::progress::ProgressDisplay;

const AFTER_HELP: &str = "\
With a model's name, the service measures on held-out frames of its people's captures: unseen
poses from the training camera. With --model-dir, this process measures on a capture folder's
eval/ (other cameras) and eval_pose/ (other poses); `yoto quality --help` shows the layout.

Examples:
  yoto evaluate duo --table
  yoto evaluate --model-dir out/models/yoto --capture data/ada --capture data/bob --table";

/// Measure a trained model on held-out pictures.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Evaluate {
    /// The trained model, by name.
    #[cfg_attr(
        feature = "embedded",
        arg(required_unless_present = "model_dir", conflicts_with = "model_dir")
    )]
    #[cfg_attr(not(feature = "embedded"), arg(required = true))]
    model: Option<String>,
    /// People to measure, by name, separated by commas [default: all people in the model].
    #[arg(long, value_delimiter = ',', value_name = "A,B,…", requires = "model")]
    #[cfg_attr(feature = "embedded", arg(conflicts_with = "model_dir"))]
    subjects: Vec<String>,
    /// Pictures to compare, and the method.
    #[arg(long, default_value = HELD_OUT, value_parser = args::protocol, long_help = protocol_help())]
    protocol: String,
    /// Step of the checkpoint to measure [default: the best one by held-out PSNR].
    #[arg(long, value_name = "STEP", requires = "model")]
    #[cfg_attr(feature = "embedded", arg(conflicts_with = "model_dir"))]
    checkpoint: Option<u64>,
    /// Longest side of compared pictures, pixels [default: that of the training images; with
    /// --model-dir the captures' size].
    #[arg(long, value_name = "PX", default_value_t = 0, hide_default_value = true, value_parser = size)]
    size: u32,
    /// Folder of a trained model (weights and state) to measure in this process.
    #[cfg(feature = "embedded")]
    #[arg(long, value_name = "DIR", requires = "captures")]
    model_dir: Option<PathBuf>,
    /// Capture folder with held-out pictures; one for each of the model's slots, in order.
    #[cfg(feature = "embedded")]
    #[arg(long = "capture", id = "captures", value_name = "DIR", num_args = 1.., requires = "model_dir", conflicts_with = "model")]
    captures: Vec<PathBuf>,
    /// Measure at most this many pictures of each kind and person [default: all].
    #[cfg(feature = "embedded")]
    #[arg(
        long = "measure",
        alias = "pictures",
        value_name = "N",
        requires = "model_dir",
        conflicts_with = "model"
    )]
    pictures: Option<std::num::NonZeroUsize>,
    /// Also print the paper's table with these figures.
    #[cfg(feature = "embedded")]
    #[arg(long)]
    table: bool,
    #[cfg(feature = "embedded")]
    #[command(flatten)]
    lpips: crate::args::LpipsArgs,
    #[command(flatten)]
    queue: QueueArgs,
    #[command(flatten)]
    server: Server,
}

fn protocol_help() -> String {
    format!(
        "Pictures to compare, and the method.{}",
        args::explained(PROTOCOLS)
    )
}

/// Parses a size large enough for SSIM, or 0.
fn size(text: &str) -> Result<u32, String> {
    match text.parse::<u32>() {
        Ok(size @ (0 | 16..=4096)) => Ok(size),
        _ => Err("0, or 16 to 4096 pixels".to_owned()),
    }
}

impl Evaluate {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        #[cfg(feature = "embedded")]
        if let Some(dir) = self.model_dir.clone() {
            return self.here(dir);
        }
        let wanted = self.model.as_deref().context("which model?")?;
        let client = self.queue.apply(self.server.connect().await?);
        let model = client.find_model(wanted).await?;
        let mut subjects = Vec::new();
        for subject in &self.subjects {
            subjects.push(client.find_subject(subject).await?.name);
        }
        let checkpoint = self
            .checkpoint
            .map(|step| names::checkpoint(&model.name, step));
        let spec = EvaluateSpec {
            model: model.name.clone(),
            subjects,
            protocol: self.protocol.clone(),
            image_size: self.size,
            tradeoff: None,
            checkpoint: checkpoint.unwrap_or_default(),
        };
        let job = client.evaluate(spec).await?;
        let mut display = ProgressDisplay::new(model.display_name.clone());
        let job = wait_for_new(&client, &job.name, &mut display).await?;
        output::put("job", output::message(&job));
        let Some(job_result::Kind::Evaluate(result)) = job.result.and_then(|it| it.kind) else {
            anyhow::bail!("{} has no figures", job.name);
        };
        display.finish(&show::evaluate_summary(&result));
        for note in &result.notes {
            tell!("note: {note}");
        }
        let size = show::size_of(result.image_size);
        say!(
            "{}: {} frames, {size}\n",
            result.checkpoint,
            result.protocol
        );
        let rows = show::score_rows(&result);
        output::put("scores", scores_json(&rows));
        say!("{}", scores_table(&rows));
        #[cfg(feature = "embedded")]
        if self.table {
            let row = crate::cli::paper_table::Row {
                variant: model.variant,
                scores: result.mean.into_iter().collect(),
            };
            let headings = ["held-out frames".to_owned()];
            say!(
                "\n{}",
                crate::cli::paper_table::paper_table(&headings, &[row])
            );
        }
        Ok(())
    }

    /// Measures a model folder in this process.
    #[cfg(feature = "embedded")]
    fn here(self, model_dir: PathBuf) -> anyhow::Result<()> {
        use crate::screen::Terminal;
        use yoto_lab::model_dir::{ModelDirOptions, run};
        let options = ModelDirOptions {
            model_dir,
            captures: self.captures,
            protocol: self.protocol,
            size: self.size,
            pictures: self
                .pictures
                .map_or(usize::MAX, std::num::NonZeroUsize::get),
            lpips: self.lpips.weights()?,
        };
        let measured = run(&options, &Terminal)?;
        output::put("scores", scores_json(&measured.rows));
        say!("step {} by {}\n", measured.step, measured.protocol);
        say!("{}", scores_table(&measured.rows));
        if self.table {
            let row = crate::cli::paper_table::Row {
                variant: measured.variant,
                scores: measured.means,
            };
            let table = crate::cli::paper_table::paper_table(&measured.headings, &[row]);
            say!("\n{table}");
        }
        Ok(())
    }
}
