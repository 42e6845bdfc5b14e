//! `yoto model export`: the files of a trained model, for use without the service.

use super::Server;
use super::job_fetch::objects;
use super::out_folder::OutFolder;
use crate::api::YotoClient;
use crate::output;
use anyhow::Context;
use clap::Args;
use yoto_proto::names;
use yoto_proto::v1::Model;

pub(super) const AFTER_HELP: &str = "\
The folder serves `yoto render-frame --model-dir DIR`, `yoto evaluate --model-dir DIR` and
`yoto model info DIR`.

Examples:
  yoto model export duo --out models/duo
  yoto model export duo --checkpoint 2000 --out models/duo-2000";

#[derive(Debug, Args)]
pub(super) struct Export {
    /// The trained model, by name.
    model: String,
    /// Step of the checkpoint [default: the best one by held-out PSNR].
    #[arg(long, value_name = "STEP")]
    checkpoint: Option<u64>,
    #[command(flatten)]
    folder: OutFolder,
    #[command(flatten)]
    server: Server,
}

/// Name of the best checkpoint of `model` by held-out PSNR.
pub(super) async fn best_checkpoint(client: &YotoClient, model: &Model) -> anyhow::Result<String> {
    let all = client.list_checkpoints(&model.name).await?;
    let best = all.into_iter().find(|checkpoint| checkpoint.best);
    let best =
        best.with_context(|| format!("{} has no checkpoint: train it first", model.display_name))?;
    Ok(best.name)
}

impl Export {
    pub(super) async fn run(self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        let model = client.find_model(&self.model).await?;
        let checkpoint = match self.checkpoint {
            Some(step) => names::checkpoint(&model.name, step),
            None => best_checkpoint(&client, &model).await?,
        };
        let paths = objects(&client, &checkpoint, &self.folder).await?;
        output::put("checkpoint", checkpoint);
        self.folder.show(&paths);
        Ok(())
    }
}
