//! `yoto-lab import-humannerf`: a checkpoint of the released HumanNeRF program as a model.

use clap::Args;
use std::path::PathBuf;
use yoto_avatar::import::{HumanNerfOptions, import_humannerf};
use yoto_terminal::output;

const AFTER_HELP: &str = "\
Writes weights.safetensors and state.json of a model of one identity, which
`yoto-lab render-frame` renders as the released program does. The model can't be trained further.
Nothing in the files is executed.

Canonical joints are used unchanged. A poses.json is suitable if the
checkpoint was trained with exactly these joints. A model trained with the pelvis at the
origin needs joints with the pelvis at the origin.

A checkpoint does not hold its training's configuration file. Its frames need N_samples;
kick-in and full-band only matter to frames of earlier iterations.

Examples:
  yoto-lab import-humannerf iter_400000.tar --canonical-joints canonical_joints.pkl --out p377
  yoto-lab import-humannerf latest.tar --canonical-joints data/ada/poses.json --out ada \\
      --kick-in 100000 --full-band 200000";

/// The program's configuration for ZJU-MoCap.
const ZJU: HumanNerfOptions = HumanNerfOptions::ZJU_MOCAP;

/// Import a checkpoint of the released HumanNeRF program as a model.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(super) struct ImportHumanNerf {
    /// The checkpoint, a file of torch.save.
    #[arg(value_name = "CHECKPOINT")]
    checkpoint: PathBuf,
    /// Canonical joints: canonical_joints.pkl, a JSON list of 24 [x, y, z] in metres, or a
    /// capture's poses.json (its rest joints).
    #[arg(long, value_name = "FILE")]
    canonical_joints: PathBuf,
    /// Folder of the new model.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Samples per ray: N_samples of the configuration.
    #[arg(
        long,
        value_name = "N",
        default_value_t = ZJU.samples as u32,
        value_parser = clap::value_parser!(u32).range(2..=4096),
    )]
    samples: u32,
    /// Iteration from which the non-rigid field is active: its kick_in_iter (wild videos: 100000).
    #[arg(long, value_name = "N", default_value_t = ZJU.kick_in)]
    kick_in: u64,
    /// Iteration from which all its bands are open: its full_band_iter (wild videos: 200000).
    #[arg(long, value_name = "N", default_value_t = ZJU.full_band)]
    full_band: u64,
}

impl ImportHumanNerf {
    pub(super) fn run(self) -> anyhow::Result<()> {
        let options = HumanNerfOptions {
            samples: self.samples as usize,
            kick_in: self.kick_in,
            full_band: self.full_band,
        };
        let imported = import_humannerf(
            &self.checkpoint,
            &self.canonical_joints,
            &self.out,
            &options,
        )?;
        let iteration = imported
            .iteration
            .map_or_else(|| "unknown".to_owned(), |iteration| iteration.to_string());
        say!(
            "{}: {} parameters, iteration {iteration}",
            self.out.display(),
            imported.parameters
        );
        output::put("files", output::paths(&[&self.out]));
        output::put("parameters", imported.parameters);
        if imported.root.iter().any(|v| *v != 0.0) {
            let [x, y, z] = imported.root;
            tell!(
                "note: canonical joints are used unchanged; the root is at \
                 [{x:.4}, {y:.4}, {z:.4}] m"
            );
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Cli {
        #[command(flatten)]
        import: ImportHumanNerf,
    }

    fn options(more: &str) -> Option<[u64; 3]> {
        let line = format!("yoto c.tar --canonical-joints j.pkl --out d{more}");
        let import = Cli::try_parse_from(line.split(' ')).ok()?.import;
        Some([u64::from(import.samples), import.kick_in, import.full_band])
    }

    #[test]
    fn what_a_checkpoint_lacks_is_zju_mocap_s_unless_given() {
        assert_eq!(options(""), Some([128, 10_000, 50_000]));
        let wild = " --samples 64 --kick-in 100000 --full-band 200000";
        assert_eq!(options(wild), Some([64, 100_000, 200_000]));
        assert_eq!(options(" --samples 1"), None);
    }
}
