//! `yoto tradeoff`: quality over time, in training and in rendering.

use crate::args;
use crate::args::Server;
use crate::files::{OutFolder, is_of_tradeoff, read_tradeoff};
use crate::screen::Terminal;
use crate::waiting::wait_for_new;
use anyhow::Context;
use clap::Args;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use yoto_avatar::tradeoff::Curve;
use yoto_client::YotoClient;
use yoto_lab::tradeoff::{Tradeoff, TradeoffOptions, run, summary};
use yoto_proto::names;
use yoto_proto::v1::{EvaluateSpec, TradeoffSpec, job_result};
use yoto_terminal::output;
use yoto_terminal::progress::ProgressDisplay;

const AFTER_HELP: &str = "\
With a model's name the service renders held-out frames of a trained model with many settings
(samples per ray, resolution, likelihood bound, early stop, precision) and stores time and PSNR
with the model's checkpoint; `yoto render --max-seconds-per-frame`, `--min-psnr` and
`--quality` use these figures. With --capture this process trains every tier with every budget,
measures each on held-out views and poses, and sweeps over render settings of the longest
trained model of each tier. `yoto quality --help` shows the layout of captures.

OUT holds tradeoff.json, tradeoff.csv, rendering.svg and .png, and training.svg and .png.

Examples:
  yoto tradeoff duo --out out/duo
  yoto tradeoff --capture data/ada data/bob --tiers draft,fast --budgets 30,60,120 --out out/t";

/// Measure quality over training time, and over render time.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct TradeoffCommand {
    /// The trained model, by name; the service measures it.
    #[arg(required_unless_present_any = ["captures", "model_flag"], conflicts_with = "captures")]
    model: Option<String>,
    /// The same as an option.
    #[arg(long = "model", hide = true, conflicts_with_all = ["captures", "model"])]
    model_flag: Option<String>,
    /// Measure again, even if this machine has measured the checkpoint before.
    #[arg(long, conflicts_with = "captures")]
    again: bool,
    /// Step of the checkpoint to measure [default: the best one by held-out PSNR].
    #[arg(long, value_name = "STEP", conflicts_with = "captures")]
    checkpoint: Option<u64>,
    /// Capture folder, for a measurement in this process; may be repeated, once per person.
    #[arg(long = "capture", id = "captures", value_name = "DIR", num_args = 1..)]
    captures: Vec<PathBuf>,
    /// Quality tiers to train, separated by commas.
    #[arg(
        long,
        value_name = "A,B,…",
        value_delimiter = ',',
        default_value = "fast,splat",
        value_parser = args::tier,
        conflicts_with_all = ["model", "model_flag"]
    )]
    tiers: Vec<String>,
    /// Seconds of training, separated by commas; each is a separate training.
    #[arg(
        long,
        value_name = "S,S,…",
        value_delimiter = ',',
        default_value = "30,60,120",
        value_parser = args::seconds,
        conflicts_with_all = ["model", "model_flag"]
    )]
    budgets: Vec<f64>,
    /// Longest side of the pictures, pixels [default: 128; of a model: the size that it was
    /// trained at].
    #[arg(long, value_name = "PX", value_parser = clap::value_parser!(u32).range(16..=4096))]
    size: Option<u32>,
    /// Random seed.
    #[arg(long, default_value_t = 7, conflicts_with_all = ["model", "model_flag"])]
    seed: u64,
    /// Measure at most this many held-out pictures of each kind and person [default: all].
    #[arg(long = "measure", alias = "pictures", value_name = "N", conflicts_with_all = ["model", "model_flag"])]
    pictures: Option<NonZeroUsize>,
    /// Held-out frames to render with each setting.
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=64))]
    views: u32,
    /// Timed renders of each frame and setting, of which the median is used.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=32))]
    repeats: u32,
    #[command(flatten)]
    folder: OutFolder,
    #[command(flatten)]
    lpips: crate::args::LpipsArgs,
    #[command(flatten)]
    server: Server,
}

impl TradeoffCommand {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        self.folder.ensure_free(is_of_tradeoff)?;
        let tradeoff = match self.model.as_ref().or(self.model_flag.as_ref()) {
            Some(name) => self.of_model(name).await?,
            None => self.of_captures()?,
        };
        let paths = tradeoff.write(&self.folder.out)?;
        say!("{}", summary(&tradeoff));
        output::put("tradeoff", serde_json::to_value(&tradeoff)?);
        output::put("files", output::paths(&paths));
        for path in paths {
            say!("{}", path.display());
        }
        Ok(())
    }

    fn of_captures(&self) -> anyhow::Result<Tradeoff> {
        let mut budgets = self.budgets.clone();
        budgets.sort_by(f64::total_cmp);
        let options = TradeoffOptions {
            captures: self.captures.clone(),
            size: self.size.unwrap_or(128),
            tiers: self.tiers.clone(),
            budgets,
            seed: self.seed,
            pictures: self.pictures.map_or(usize::MAX, NonZeroUsize::get),
            views: self.views as usize,
            repeats: self.repeats as usize,
            lpips: self.lpips.clone().weights()?,
        };
        run(&options, &Terminal)
    }

    async fn of_model(&self, name: &str) -> anyhow::Result<Tradeoff> {
        let client = self.server.connect().await?;
        let model = client.find_model(name).await?;
        let checkpoint = self
            .checkpoint
            .map(|step| names::checkpoint(&model.name, step));
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
        let wanted = checkpoints.iter().find(|it| match self.checkpoint {
            Some(step) => it.step == step,
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
        if !(same_size && same_machine && curve.repeats >= self.repeats as usize) {
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
