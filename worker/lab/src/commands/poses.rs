//! `yoto-lab poses`: what a film alone tells of poses.

use super::actors::ActorArgs;
use super::import_progress;
use super::screen::Terminal;
use crate::lift::read_motions;
use crate::poses::{FILE, PosesOptions, run};
use anyhow::Context;
use clap::Args;
use std::path::{Path, PathBuf};
use yoto_import::{FfmpegArg, Options};
use yoto_terminal::output;

const AFTER_HELP: &str = "\
Each person is filmed before a wall as a phone films: in a whole turn, facing the camera, and in sport, from the height
of the chest; and in the turn from 0.5 and from 2.1 m. The light drifts, the lens blurs, and pictures have noise. People
of a --capture move as it says. The pose model and the fit then look at the pictures alone.

Columns are errors against the truth: of 13 joints in space, across the line of sight and along it, of the wrists along
it, and of all joints once each frame is rotated and scaled to the truth; of the rotations of wrists and head; of bones'
lengths. 'mistaken' are frames in which left is taken for right. Hips are at the same place in both, and one factor per
film brings both bodies to one size. OUT/poses.json has all figures, OUT/FILM the pictures.

DIR is a folder that `yoto-lab body` learns from.

Examples:
  yoto-lab poses --bodies bodies --body white_m_1_casual asian_f_1_busi --pose-model models --out poses
  yoto-lab poses --capture captures/ada captures/bruno --pose-model models --out poses";

/// Measure the poses that are found in films of people whose poses are known.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(super) struct PosesCommand {
    #[command(flatten)]
    actors: ActorArgs,
    /// Folder of a capture with exact poses and masks; may be repeated.
    #[arg(long = "capture", id = "captures", value_name = "DIR", num_args = 1..)]
    captures: Vec<PathBuf>,
    /// Folder of motions (BVH or AMASS-style .npz) that people and bodies do, one each in turn, in place of the usual films; may be
    /// repeated.
    #[arg(long = "motion", id = "motions", value_name = "DIR", num_args = 1..)]
    motions: Vec<PathBuf>,
    /// Give bodies fingers that open and close, and faces that speak and blink.
    #[arg(long, requires = "bodies")]
    parts: bool,
    /// Height of the pictures of people and bodies, pixels.
    #[arg(long, value_name = "PX", default_value_t = 512, value_parser = clap::value_parser!(u32).range(64..=2048))]
    size: u32,
    /// The pose model: a file, or the folder that deploy/models/get.sh filled.
    #[arg(long, value_name = "PATH", env = "YOTO_POSE_MODEL")]
    pose_model: Option<PathBuf>,
    /// Folder for the figures and the films.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    ffmpeg: FfmpegArg,
}

impl PosesCommand {
    pub(super) fn run(self) -> anyhow::Result<()> {
        std::fs::create_dir_all(&self.out)
            .with_context(|| format!("making {}", self.out.display()))?;
        let options = PosesOptions {
            bodies: self.actors.bodies.meshes(self.parts)?,
            people: self.actors.people.into(),
            captures: self.captures,
            motions: read_motions(&self.motions)?,
            size: self.size,
            import: Options {
                pose_model: self.pose_model,
                ffmpeg: self.ffmpeg.program().map(Path::to_owned),
                progress: import_progress::on_terminal(),
                ..Options::default()
            },
            out: self.out.clone(),
        };
        let poses = run(&options, &Terminal)?;
        let path = self.out.join(FILE);
        say!("{}", poses.table());
        say!("figures: {}", path.display());
        output::put("files", output::paths(&[&path]));
        Ok(())
    }
}
