//! `yoto-lab lift`: the network that finds the depth of key points.

use super::screen::Terminal;
use crate::lift::{LiftSettings, learn, read_motions};
use crate::poses::MeasuredErrors;
use anyhow::Context;
use clap::Args;
use std::path::PathBuf;
use yoto_pose::lift::BONES;
use yoto_terminal::output;

const AFTER_HELP: &str = "\
Motions are BVH or AMASS-style .npz files, at any depth below DIR. Random cameras see them as the pose model would, with
its measured errors. One clip in ten is kept to measure on. docs/research/poses.md names the motions that the program's
own network is learned from.

Examples:
  yoto-lab lift motions/cmu motions/idle --errors errors.json --out lift.safetensors
  yoto-lab lift motions --errors errors.json --steps 2000 --note 'licence=MIT' --out lift.safetensors";

/// Learn the network that finds the depth of key points, from motions.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(super) struct LiftCommand {
    /// Folder of motions; may be repeated.
    #[arg(value_name = "DIR", required = true)]
    motions: Vec<PathBuf>,
    /// Errors of the pose model, by `yoto-lab detector`.
    #[arg(long, value_name = "FILE")]
    errors: PathBuf,
    /// Training steps, of 512 examples each.
    #[arg(long, default_value_t = 12_000, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    steps: u32,
    /// Seed of weights and examples.
    #[arg(long, default_value_t = 0, value_name = "N")]
    seed: u64,
    /// A fact for the file, such as its licence; may be repeated.
    #[arg(long = "note", value_name = "NAME=TEXT", value_parser = super::decoder::note)]
    notes: Vec<(String, String)>,
    /// The network's file.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

impl LiftCommand {
    pub(super) fn run(self) -> anyhow::Result<()> {
        let clips = read_motions(&self.motions)?;
        let frames: usize = clips.iter().map(|clip| clip.frames.len()).sum();
        say!("{} motions, {frames} frames", clips.len());
        let path = &self.errors;
        let reading = || format!("the errors {}", path.display());
        let errors = std::fs::read(path).with_context(reading)?;
        let errors: MeasuredErrors = serde_json::from_slice(&errors).with_context(reading)?;
        let settings = LiftSettings {
            steps: self.steps as usize,
            seed: self.seed,
        };
        let learned = learn(clips, errors.errors()?, settings, &Terminal)?;
        say!(
            "error of the depth of bones on motions that were kept, mm: by the network, by the detector"
        );
        for ([from, to], [found, told]) in BONES.into_iter().zip(&learned.bones_mm) {
            say!("  {from:2} to {to:2}  {found:4.0} {told:4.0}");
        }
        let bytes = learned.network.to_bytes(&self.notes)?;
        std::fs::write(&self.out, &bytes)
            .with_context(|| format!("writing {}", self.out.display()))?;
        say!("{} bytes: {}", bytes.len(), self.out.display());
        output::put("files", output::paths(&[&self.out]));
        Ok(())
    }
}
