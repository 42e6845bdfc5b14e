//! `yoto-lab stress`: people in poses that no film shows.

use super::actors::ActorArgs;
use super::args;
use super::quality::capture_source;
use super::screen::Terminal;
use crate::stress::{FILE, StressOptions, run};
use anyhow::Context;
use clap::Args;
use std::path::PathBuf;
use yoto_avatar::config::Setting;
use yoto_import::FfmpegArg;
use yoto_terminal::output;

const AFTER_HELP: &str = "\
Each person is filmed in a turn with arms down. One model learns all of them, and renders each in 24 poses that the
films lack, from two sides, and in a filmed pose from eight sides. The truth is known, so that the figures are PSNR in
the box around the person, the overlap of both outlines, holes more than 1 cm inside of the true outline, and surface
more than 3 cm outside of it, both as shares of the person's area.

OUT/NAME.png has the poses, truth above render; OUT/NAME-sides.png the sides; OUT/stress.json all figures.

Of the person of a --capture there are sheets alone, since nobody knows how they look then; each 20th frame of a film is left out, as in other measurements.

DIR is a folder that `yoto-lab body` learns from. Measure on bodies that the model of bodies was learned without.

Examples:
  yoto-lab stress --people 3 --out stress
  yoto-lab stress --bodies bodies --body white_m_1_casual asian_f_1_busi --sector 45 --out front-only
  yoto-lab stress --capture captures/ada --size 512 --steps 1200 --out ada";

/// Render people in poses that no film shows, beside the truth.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(super) struct StressCommand {
    #[command(flatten)]
    actors: ActorArgs,
    /// Capture of a person, laid out as `yoto-lab quality --help` says; may be repeated.
    #[arg(long = "capture", value_name = "DIR", num_args = 1..)]
    captures: Vec<PathBuf>,
    /// Film people within this angle to either side of their front, degrees [default: a whole turn].
    #[arg(long, value_name = "DEGREES", value_parser = clap::value_parser!(u8).range(0..=180))]
    sector: Option<u8>,
    /// Give bodies fingers and faces that move, and measure both from near.
    #[arg(long, requires = "bodies")]
    parts: bool,
    /// Leave fingers and faces out of the poses that people are trained with.
    #[arg(long, requires = "parts")]
    hide_parts: bool,
    /// Steps per person.
    #[arg(long, value_name = "N", default_value_t = 400, value_parser = clap::value_parser!(u64).range(1..))]
    steps: u64,
    /// Longest side of the pictures, pixels.
    #[arg(long, value_name = "PX", default_value_t = 256, value_parser = clap::value_parser!(u32).range(32..=4096))]
    size: u32,
    /// Quality tier: speed against detail.
    #[arg(long, default_value = "splat", value_parser = args::tier, long_help = args::tier_help())]
    tier: String,
    /// Different value for one of the tier's settings; may be repeated.
    #[arg(long = "set", value_name = "NAME=VALUE")]
    settings: Vec<Setting>,
    /// Seed of everything random.
    #[arg(long, value_name = "N", default_value_t = 7)]
    seed: u64,
    /// Folder for the figures and the sheets.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    ffmpeg: FfmpegArg,
}

impl StressCommand {
    pub(super) fn run(self) -> anyhow::Result<()> {
        let captures = self.captures.iter();
        let captures = captures.map(|path| capture_source(path, self.ffmpeg.program()));
        let captures = captures.collect::<anyhow::Result<_>>()?;
        std::fs::create_dir_all(&self.out)
            .with_context(|| format!("making {}", self.out.display()))?;
        let options = StressOptions {
            people: self.actors.people.into(),
            bodies: self.actors.bodies.meshes(self.parts)?,
            hide_parts: self.hide_parts,
            captures,
            sector: self.sector.map(|degrees| f64::from(degrees).to_radians()),
            size: self.size,
            steps: self.steps,
            tier: self.tier,
            settings: self.settings,
            seed: self.seed,
            out: self.out.clone(),
        };
        let stress = run(&options, &Terminal)?;
        let path = self.out.join(FILE);
        say!("{}", stress.table());
        say!("figures: {}", path.display());
        output::put("files", output::paths(&[&path]));
        Ok(())
    }
}
