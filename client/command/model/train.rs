//! `yoto train`: train a model.

use super::create::{Shape, create_with};
use super::preview::Previews;
use crate::args::train::TrainArgs;
use crate::args::{QueueArgs, Server, tier_help, variant_help};
use crate::waiting::follow_new;
use crate::{args, show};
use anyhow::{Context, bail};
use clap::Args;
use std::path::PathBuf;
use yoto_client::YotoClient;
use yoto_proto::checks::train::of_tier;
use yoto_proto::tiers::DEFAULT_TIER;
use yoto_proto::v1::{Model, TrainSpec, job_result};
use yoto_terminal::output::{self, others};
use yoto_terminal::progress::ProgressDisplay;

const AFTER_HELP: &str = "\
Training resumes from the model's newest checkpoint. Interrupting this command does not
stop the job: watch it with `yoto job watch`, end it with `yoto job cancel`.

Examples:
  yoto train duo --subjects ada,bob            create the model 'duo', then train it
  yoto train duo --seconds 600                 continue its training
  yoto train duo --seconds 600 --preview progress
  yoto train duo --steps 2000 --size 256 --no-wait
  yoto train duo --only cleo --seconds 60      nobody else changes";

/// Train a model on all its people at once.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Train {
    /// The model, by name; with --subjects the name of the model to create.
    model: String,
    /// Create the model first, with these people, separated by commas.
    #[arg(long, value_delimiter = ',', value_name = "A,B,…")]
    subjects: Vec<String>,
    /// Train only this person's own parameters, on their frames alone: everybody else renders bit for bit as
    /// before.
    #[arg(long, value_name = "PERSON", conflicts_with = "subjects")]
    only: Option<String>,
    /// Quality tier of the new model [default: splat].
    #[arg(long, requires = "subjects", value_parser = args::tier, long_help = tier_help())]
    tier: Option<String>,
    /// Variant of the new model [default: yoto].
    #[arg(long, requires = "subjects", value_parser = args::variant, long_help = variant_help())]
    variant: Option<String>,
    /// Budget in seconds of training [default: the run length of the model's tier, 5000 steps, or
    /// 400000 for the tiers of the paper].
    #[arg(long, value_parser = args::seconds, conflicts_with = "steps", value_name = "S")]
    seconds: Option<f64>,
    /// Budget in steps, in place of seconds.
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    steps: Option<u64>,
    /// Longest side of the training images, pixels [default: as in the model's last training, or for
    /// an untrained model the captures' size].
    #[arg(
        long,
        default_value_t = 0,
        hide_default_value = true,
        value_name = "PX"
    )]
    size: u32,
    /// Longest time between checkpoints, seconds; after half of it, a step that was just measured gets one [default:
    /// such that checkpoints take less than 3 % of the time, at least 30].
    #[arg(long, value_parser = args::seconds, value_name = "S")]
    checkpoint_seconds: Option<f64>,
    #[command(flatten)]
    train: TrainArgs,
    /// Write a picture for each checkpoint: a held-out frame of each person beside its render.
    #[arg(long, value_name = "DIR", conflicts_with = "no_wait")]
    preview: Option<PathBuf>,
    /// Queue the job and return.
    #[arg(long)]
    no_wait: bool,
    #[command(flatten)]
    queue: QueueArgs,
    #[command(flatten)]
    server: Server,
}

impl Train {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let client = self.queue.apply(self.server.connect().await?);
        if let Some(dir) = &self.preview {
            std::fs::create_dir_all(dir)
                .with_context(|| format!("making the folder {}", dir.display()))?;
        }
        let model = if self.subjects.is_empty() {
            client.find_model(&self.model).await?
        } else {
            let shape = Shape {
                tier: self.tier.unwrap_or_else(|| DEFAULT_TIER.to_owned()),
                variant: self.variant.unwrap_or_else(|| "yoto".to_owned()),
            };
            // Before the model is created: a fault must leave no model behind.
            if let Some(fault) = of_tier(&self.train.spec(), &shape.tier).first() {
                bail!("--{}: {}", fault.field, fault.message);
            }
            create_with(&client, &self.model, &self.subjects, &shape).await?
        };
        let only = match &self.only {
            Some(person) => client.find_subject(person).await?.name,
            None => String::new(),
        };
        let spec = TrainSpec {
            only,
            model: model.name.clone(),
            seconds: self.seconds.unwrap_or(0.0),
            steps: self.steps.unwrap_or(0),
            image_size: self.size,
            checkpoint_seconds: self.checkpoint_seconds.unwrap_or(0.0),
            ..self.train.spec()
        };
        trained(&client, &model, spec, self.preview, self.no_wait).await
    }
}

/// Queues the training `spec` of a model. Unless `no_wait`, follows it to its end and prints its result.
pub(crate) async fn trained(
    client: &YotoClient,
    model: &Model,
    spec: TrainSpec,
    preview: Option<PathBuf>,
    no_wait: bool,
) -> anyhow::Result<()> {
    let job = client.train(spec).await?;
    say!("{}", job.name);
    output::put("job", output::message(&job));
    if no_wait {
        return Ok(());
    }
    let mut display = ProgressDisplay::new(model.display_name.clone());
    let previews = preview.map(|dir| {
        let shown = dir.join("STEP.png");
        let mut told = false;
        Previews::start(client, &model.name, dir, move |_, _| {
            if !told {
                tell!(
                    "previews: {}: held-out frames left, renders right",
                    shown.display()
                );
            }
            told = true;
        })
    });
    let job = follow_new(client, &job.name, &mut display, |job| {
        if let Some(previews) = &previews {
            previews.look(job);
        }
    })
    .await?;
    output::put("job", output::message(&job));
    if let Some(previews) = previews {
        output::put("previews", output::paths(&previews.finish().await?));
    }
    match job.result.and_then(|result| result.kind) {
        Some(job_result::Kind::Train(result)) => {
            display.clear();
            say!("{}", show::train_summary(&result));
            for note in &result.notes {
                say!("{}", others(note));
            }
        }
        _ => display.finish("done"),
    }
    Ok(())
}
