//! `yoto evaluate`: quality of a trained model on held-out pictures.

use crate::args::version::Version;
use crate::args::{QueueArgs, Server};
use crate::waiting::wait_for_new;
use crate::{args, show};
use clap::Args;
use yoto_proto::protocols::{HELD_OUT, PROTOCOLS};
use yoto_proto::v1::{EvaluateSpec, job_result};
use yoto_terminal::output::{self, others};
use yoto_terminal::progress::ProgressDisplay;
use yoto_terminal::scores::{scores_json, scores_table};

const AFTER_HELP: &str = "\
The service measures on held-out frames of the people's captures: unseen poses from the training
camera.

Example:
  yoto evaluate duo --table";

/// Measure a trained model on held-out pictures.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Evaluate {
    /// The trained model, by name.
    model: String,
    /// People to measure, by name, separated by commas [default: all people in the model].
    #[arg(long, value_delimiter = ',', value_name = "A,B,…")]
    subjects: Vec<String>,
    /// Protocol: which pictures are compared, and how.
    #[arg(long, default_value = HELD_OUT, value_parser = args::protocol, long_help = protocol_help())]
    protocol: String,
    /// Step or alias of the checkpoint to measure [default: the best one by held-out PSNR].
    #[arg(long, value_name = "STEP|ALIAS")]
    checkpoint: Option<Version>,
    /// Longest side of compared pictures, pixels [default: the side of the training images].
    #[arg(long, value_name = "PX", default_value_t = 0, hide_default_value = true, value_parser = size)]
    size: u32,
    /// Also print the paper's table with these figures.
    #[cfg(feature = "embedded")]
    #[arg(long)]
    table: bool,
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
        let client = self.queue.apply(self.server.connect().await?);
        let model = client.find_model(&self.model).await?;
        let mut subjects = Vec::new();
        for subject in &self.subjects {
            subjects.push(client.find_subject(subject).await?.name);
        }
        let checkpoint = self.checkpoint.as_ref().map(|it| it.of(&model.name));
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
            tell!("note: {}", others(note));
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
            let row = yoto_avatar::evaluate::Row {
                variant: model.variant,
                scores: result.mean.into_iter().collect(),
            };
            let headings = ["held-out frames".to_owned()];
            say!(
                "\n{}",
                yoto_avatar::evaluate::paper_table(&headings, &[row])
            );
        }
        Ok(())
    }
}
