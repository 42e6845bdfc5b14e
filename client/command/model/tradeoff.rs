//! `yoto tradeoff`: quality of a model's renders over their time.

use crate::args::Server;
use crate::args::version::Version;
use crate::files::{OutFolder, is_of_tradeoff, read_tradeoff};
use crate::waiting::wait_for_new;
use anyhow::Context;
use clap::Args;
use yoto_avatar::tradeoff::{Curve, Tradeoff};
use yoto_client::YotoClient;
use yoto_proto::v1::{EvaluateSpec, TradeoffSpec, job_result};
use yoto_terminal::output;
use yoto_terminal::progress::ProgressDisplay;

const AFTER_HELP: &str = "\
The service renders held-out frames of a trained model with many settings (samples per ray,
resolution, likelihood bound, early stop, precision; for splats, their number and the resolution)
and stores time and PSNR with the model's checkpoint. `yoto render --max-seconds-per-frame`,
`--min-psnr` and `--quality` use these figures.

OUT holds tradeoff.json and tradeoff.csv.

Example:
  yoto tradeoff duo --out out/duo";

/// Measure quality over render time.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct TradeoffCommand {
    /// The trained model, by name.
    #[arg(required_unless_present = "model_flag")]
    model: Option<String>,
    /// The same as an option.
    #[arg(long = "model", hide = true, conflicts_with = "model")]
    model_flag: Option<String>,
    /// Measure again, even if this machine has measured the checkpoint before.
    #[arg(long)]
    again: bool,
    /// Step or alias of the checkpoint to measure [default: the best one by held-out PSNR].
    #[arg(long, value_name = "STEP|ALIAS")]
    checkpoint: Option<Version>,
    /// Longest side of the pictures, pixels [default: the size that the model was trained at].
    #[arg(long, value_name = "PX", value_parser = clap::value_parser!(u32).range(16..=4096))]
    size: Option<u32>,
    /// Held-out frames to render with each setting.
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=64))]
    views: u32,
    /// Timed renders of each frame and setting, of which the median is used.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=32))]
    repeats: u32,
    #[command(flatten)]
    folder: OutFolder,
    #[command(flatten)]
    server: Server,
}

impl TradeoffCommand {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        self.folder.ensure_free(is_of_tradeoff)?;
        let name = self.model.as_ref().or(self.model_flag.as_ref());
        let tradeoff = self.of_model(name.context("no model is given")?).await?;
        let paths = tradeoff.write(&self.folder.out)?;
        say!("{}", tradeoff.summary());
        output::put("tradeoff", serde_json::to_value(&tradeoff)?);
        output::put("files", output::paths(&paths));
        for path in paths {
            say!("{}", path.display());
        }
        Ok(())
    }

    async fn of_model(&self, name: &str) -> anyhow::Result<Tradeoff> {
        let client = self.server.connect().await?;
        let model = client.find_model(name).await?;
        let checkpoint = self.checkpoint.as_ref().map(|it| it.of(&model.name));
        if !self.again
            && let Some(kept) = self.kept(&client, &model.name).await?
        {
            return Ok(kept);
        }
        let spec = EvaluateSpec {
            checkpoint: checkpoint.unwrap_or_default(),
            model: model.name,
            image_size: self.size.unwrap_or(0),
            tradeoff: Some(TradeoffSpec {
                views: self.views,
                repeats: self.repeats,
            }),
            ..EvaluateSpec::default()
        };
        let job = client.evaluate(spec).await?;
        let mut display = ProgressDisplay::new(model.display_name.clone());
        let job = wait_for_new(&client, &job.name, &mut display).await?;
        let Some(job_result::Kind::Evaluate(result)) = job.result.and_then(|it| it.kind) else {
            anyhow::bail!("{} has no figures", job.name);
        };
        display.finish(&format!("kept with {}", result.checkpoint));
        let json = client.get_tradeoff(&result.checkpoint).await?;
        read_tradeoff(&client, &result.checkpoint, &json).await
    }

    /// What was measured before on the worker's machine, with the same pictures.
    async fn kept(&self, client: &YotoClient, model: &str) -> anyhow::Result<Option<Tradeoff>> {
        let checkpoints = client.list_checkpoints(model).await?;
        let named = self.checkpoint.as_ref().map(|it| it.of(model));
        let wanted = checkpoints.iter().find(|it| match &named {
            Some(name) => {
                let mut aliases = it.aliases.iter();
                it.name == *name
                    || aliases.any(|alias| *name == format!("{model}/checkpoints/{alias}"))
            }
            None => it.best,
        });
        let Some(checkpoint) = wanted.filter(|it| it.tradeoff.is_some()) else {
            return Ok(None);
        };
        let json = client.get_tradeoff(&checkpoint.name).await?;
        let curve = Curve::from_json(&json)
            .with_context(|| format!("the trade-off of {}", checkpoint.name))?;
        let size = self.size.unwrap_or(checkpoint.image_size);
        let same_size = size == 0 || size == curve.size;
        let status = client.status().await?;
        let mut devices = status.workers.iter().filter_map(|it| it.device.as_ref());
        let same_machine = devices.any(|it| it.adapter == curve.machine.device);
        // Fewer people may have fewer held-out frames than were asked for.
        if !(curve.is_current()
            && same_size
            && same_machine
            && curve.repeats >= self.repeats as usize)
        {
            return Ok(None);
        }
        tell!(
            "measured before, on {} with {} frames: --again measures anew",
            curve.machine.device,
            curve.views
        );
        read_tradeoff(client, &checkpoint.name, &json)
            .await
            .map(Some)
    }
}
