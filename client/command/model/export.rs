//! `yoto model export`: the files of a trained model, for use without the service.

use crate::args::Server;
use crate::args::version::Version;
use crate::files::{OutFolder, download};
use clap::Args;
use yoto_terminal::output;

pub(crate) const AFTER_HELP: &str = "\
The folder serves `yoto-lab render-frame --model-dir DIR`, `yoto-lab evaluate --model-dir DIR` and
`yoto-lab info DIR`.

Examples:
  yoto model export duo --out models/duo
  yoto model export duo --checkpoint 2000 --out models/duo-2000";

#[derive(Debug, Args)]
pub(crate) struct Export {
    /// The trained model, by name.
    model: String,
    /// Step or alias of the checkpoint [default: the best one by held-out PSNR].
    #[arg(long, value_name = "STEP|ALIAS")]
    checkpoint: Option<Version>,
    #[command(flatten)]
    folder: OutFolder,
    #[command(flatten)]
    server: Server,
}

impl Export {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let client = self.server.connect().await?;
        let model = client.find_model(&self.model).await?;
        let checkpoint = match &self.checkpoint {
            Some(version) => client.get_checkpoint(&version.of(&model.name)).await?.name,
            None => client.checkpoint_name(&model).await?,
        };
        let paths = download(&client, &checkpoint, &self.folder).await?;
        output::put("checkpoint", checkpoint);
        self.folder.show(&paths);
        Ok(())
    }
}
