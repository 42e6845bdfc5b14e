//! `yoto train`: train a model.

use super::Server;
use super::exposure::Exposure;
use super::model::{create_with, tier_help, variant_help};
use super::refine_poses::RefinePoses;
use super::train_preview::Previews;
use super::turn_args::TurnArgs;
use super::waiting::follow_new;
use super::{model, table};
use anyhow::{Context, bail};
use clap::Args;
use std::path::PathBuf;
use yoto_client::YotoClient;
use yoto_proto::checks::train::of_tier;
use yoto_proto::tiers::DEFAULT_TIER;
use yoto_proto::v1::{Model, TrainResult, TrainSpec, job_result};
use yoto_terminal::output;
use yoto_terminal::progress::{ProgressDisplay, duration};

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
pub(super) struct Train {
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
    #[arg(long, requires = "subjects", value_parser = table::tier, long_help = tier_help())]
    tier: Option<String>,
    /// Variant of the new model [default: yoto].
    #[arg(long, requires = "subjects", value_parser = table::variant, long_help = variant_help())]
    variant: Option<String>,
    /// Budget in seconds of training [default: the run length of the model's tier, 5000 steps, or
    /// 400000 for the tiers of the paper].
    #[arg(long, value_parser = table::seconds, conflicts_with = "steps", value_name = "S")]
    seconds: Option<f64>,
    /// Budget in steps, in place of seconds.
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    steps: Option<u64>,
    /// Random seed; a model with earlier training keeps its own.
    #[arg(long, default_value_t = 7)]
    seed: u64,
    /// Longest side of the training images, pixels [default: as in the model's last training, or for
    /// an untrained model the captures' size].
    #[arg(
        long,
        default_value_t = 0,
        hide_default_value = true,
        value_name = "PX"
    )]
    size: u32,
    /// Seconds between checkpoints [default: so many that they take at most 3 % of the time, at least
    /// 30].
    #[arg(long, value_parser = table::seconds, value_name = "S")]
    checkpoint_seconds: Option<f64>,
    /// Refine the poses of the training frames: always, never, or auto, for people whose bodies
    /// wander off their masks or jump, as estimated poses do [default: as before, or by the tier: auto,
    /// or never for the tiers of the paper].
    #[arg(long, value_enum, value_name = "WHEN", num_args = 0..=1, default_missing_value = "always", require_equals = true)]
    refine_poses: Option<RefinePoses>,
    /// Learn a gain and an offset of each training frame and colour channel: always, never, or auto, for films whose
    /// frames are exposed differently [default: as before, or by the tier: auto for splat, else never].
    #[arg(long, value_enum, value_name = "WHEN")]
    exposure: Option<Exposure>,
    /// Let the colours of splats depend on the view, by spherical harmonics of this degree, 0 to 2: for what shines [default: as
    /// before, or 0].
    #[arg(long, value_name = "DEGREE", value_parser = clap::value_parser!(u32).range(0..=2))]
    harmonics: Option<u32>,
    /// Leave the colours of what no frame shows as training left them, in place of guesses from what is seen.
    #[arg(long)]
    leave_unseen: bool,
    /// Write a picture for each checkpoint: a held-out frame of each person beside its render.
    #[arg(long, value_name = "DIR", conflicts_with = "no_wait")]
    preview: Option<PathBuf>,
    /// Queue the job and return.
    #[arg(long)]
    no_wait: bool,
    #[command(flatten)]
    turn: TurnArgs,
    #[command(flatten)]
    server: Server,
}

impl Train {
    pub(super) async fn run(self) -> anyhow::Result<()> {
        let client = self.turn.on(self.server.connect().await?);
        if let Some(dir) = &self.preview {
            std::fs::create_dir_all(dir)
                .with_context(|| format!("making the folder {}", dir.display()))?;
        }
        let model = if self.subjects.is_empty() {
            client.find_model(&self.model).await?
        } else {
            let shape = model::Shape {
                tier: self.tier.unwrap_or_else(|| DEFAULT_TIER.to_owned()),
                variant: self.variant.unwrap_or_else(|| "yoto".to_owned()),
            };
            // Before a model is there that nobody wants.
            let wanted = TrainSpec {
                harmonics: self.harmonics,
                ..TrainSpec::default()
            };
            if let Some(fault) = of_tier(&wanted, &shape.tier).first() {
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
            seed: self.seed,
            image_size: self.size,
            checkpoint_seconds: self.checkpoint_seconds.unwrap_or(0.0),
            refine_poses: self.refine_poses.map_or(0, |when| when.message().into()),
            exposure: self.exposure.map_or(0, |when| when.message().into()),
            harmonics: self.harmonics,
            leave_unseen: self.leave_unseen,
        };
        trained(&client, model, spec, self.preview, self.no_wait).await
    }
}

/// Queues the training `spec` of a model, and unless nobody waits follows it to its end and says what it gave.
pub(super) async fn trained(
    client: &YotoClient,
    model: Model,
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
    let mut display = ProgressDisplay::new(model.display_name);
    let previews = preview.map(|dir| Previews::start(client, &model.name, dir));
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
            say!("{}", summary(&result));
            for note in &result.notes {
                say!("{note}");
            }
        }
        _ => display.finish("done"),
    }
    Ok(())
}

/// `24.12 dB in the box, 32.80 dB whole, on 6 held-out frames of 128 pixels; 2341 steps in 5:00 on
/// cpu…, 1.2 M parameters, checkpoint … (9.3 MB)`.
pub(super) fn summary(result: &TrainResult) -> String {
    let size = table::size_of(result.image_size);
    let quality = match (result.psnr_mask_box, result.psnr) {
        (Some(inside), Some(whole)) => format!(
            "{inside:.2} dB in the box, {whole:.2} dB whole, on {} held-out frames of {size}; ",
            result.held_out
        ),
        (None, Some(whole)) => {
            format!(
                "{whole:.2} dB on {} held-out frames of {size}; ",
                result.held_out
            )
        }
        (_, None) => String::new(),
    };
    format!(
        "{quality}{} steps in {} on {}, {:.2} M parameters, {} ({:.1} MB)",
        result.steps,
        duration(result.train_seconds),
        result.device,
        result.parameters as f64 / 1e6,
        result.checkpoint,
        result.checkpoint_bytes as f64 / 1e6
    )
}
