//! `yoto-lab detector`: how the pose model errs.

use super::actors::BodyArgs;
use super::screen::Terminal;
use crate::lift::read_motions;
use crate::poses::{DetectorOptions, measure};
use anyhow::Context;
use clap::Args;
use std::path::PathBuf;
use yoto_terminal::output;

const AFTER_HELP: &str = "\
Bodies move as in the motions, before a wall, seen by cameras of several heights. The pose model looks at the pictures,
and what it finds is compared with the truth. `yoto-lab lift` learns from these errors.

DIR is a folder that `yoto-lab body` learns from.

Examples:
  yoto-lab detector --bodies bodies --body black_m_1_casual white_f_2_busi --motion motions --pose-model models --out errors.json";

/// Measure how the pose model errs.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(super) struct DetectorCommand {
    #[command(flatten)]
    bodies: BodyArgs,
    /// Folder of motions (BVH or AMASS-style .npz), which the bodies do in turn; may be repeated.
    #[arg(long = "motion", id = "motions", value_name = "DIR", required = true, num_args = 1..)]
    motions: Vec<PathBuf>,
    /// Height of the pictures, pixels.
    #[arg(long, value_name = "PX", default_value_t = 384, value_parser = clap::value_parser!(u32).range(64..=2048))]
    size: u32,
    /// The pose model: a file, or the folder that deploy/models/get.sh filled.
    #[arg(long, value_name = "PATH", env = "YOTO_POSE_MODEL")]
    pose_model: PathBuf,
    /// File of the errors.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

impl DetectorCommand {
    pub(super) fn run(self) -> anyhow::Result<()> {
        let options = DetectorOptions {
            bodies: self.bodies.meshes(false)?,
            motions: read_motions(&self.motions)?,
            size: self.size,
            model: &self.pose_model,
        };
        let errors = measure(options, &Terminal)?;
        let json = serde_json::to_vec(&errors).context("encoding the errors")?;
        std::fs::write(&self.out, json)
            .with_context(|| format!("writing {}", self.out.display()))?;
        say!("errors: {}", self.out.display());
        output::put("files", output::paths(&[&self.out]));
        Ok(())
    }
}
