//! `yoto model erase-person`: a checkpoint's folder without one of its people.

use anyhow::Context;
use clap::Args;
use std::path::PathBuf;
use yoto_avatar::train::leaving::remove_person;
use yoto_terminal::output;

pub(crate) const AFTER_HELP: &str = "\
Nothing of the person is in the new folder: no parameters, moments of the optimiser, occupancy, poses,
skeleton or pictures; everybody else's part is the same bit for bit. The files are then searched for what
was the person's. OUT/removed-SLOT.json is a certificate: private_only if the person joined a trained model
alone, or trunk_saw_them if the shared part learned from their frames, which no removal can undo.
Slots are counted from 0 in the order in which people came into the model: `yoto model show`.

Examples:
  yoto model export duo --out models/duo
  yoto model erase-person models/duo --slot 2 --out models/duo-without-cleo";

#[derive(Debug, Args)]
pub(crate) struct Erase {
    /// Folder of a checkpoint, such as `yoto model export` writes.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// The person's slot.
    #[arg(long, value_name = "N")]
    slot: usize,
    /// New folder for the checkpoint without the person.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

impl Erase {
    pub(crate) fn run(self) -> anyhow::Result<()> {
        let certificate = remove_person(&self.folder, &self.out, self.slot)?;
        let json = serde_json::to_value(&certificate)?;
        let path = self.out.join(format!("removed-{}.json", self.slot));
        std::fs::write(&path, serde_json::to_vec_pretty(&json)?)
            .with_context(|| format!("writing {}", path.display()))?;
        output::put("certificate", json);
        say!("{}", certificate.says());
        say!("{}", path.display());
        Ok(())
    }
}
