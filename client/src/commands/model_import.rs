//! `yoto model import-humannerf`: a checkpoint of the released HumanNeRF program as a model.

use clap::Args;
use std::path::PathBuf;
use yoto_avatar::import::import_humannerf;

pub(super) const AFTER_HELP: &str = "\
Writes weights.safetensors and state.json of a model of one identity, which
`yoto render-frame` renders as the released program does. It does not train on.
Nothing in the files is run.

Examples:
  yoto model import-humannerf iter_400000.tar --canonical-joints canonical_joints.pkl --out p377
  yoto model import-humannerf latest.tar --canonical-joints data/ada/poses.json --out ada";

#[derive(Debug, Args)]
pub(super) struct ImportHumanNerf {
    /// The checkpoint, as torch.save wrote it.
    #[arg(value_name = "CHECKPOINT")]
    checkpoint: PathBuf,
    /// Canonical joints: canonical_joints.pkl, a JSON list of 24 [x, y, z] in metres, or a
    /// capture's poses.json.
    #[arg(long, value_name = "FILE")]
    canonical_joints: PathBuf,
    /// Folder of the new model.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

impl ImportHumanNerf {
    pub(super) fn run(self) -> anyhow::Result<()> {
        let imported = import_humannerf(&self.checkpoint, &self.canonical_joints, &self.out)?;
        let iteration = imported
            .iteration
            .map_or_else(|| "unknown".to_owned(), |iteration| iteration.to_string());
        println!(
            "{}: {} parameters, iteration {iteration}",
            self.out.display(),
            imported.parameters
        );
        Ok(())
    }
}
