//! `yoto avatar`: from a clip to a page, in one command.

use crate::args;
use crate::args::capture::{ClipMasks, ImportOptions};
use crate::args::frame_range::FrameRange;
use crate::args::motion::MotionArgs;
use crate::args::train::TrainArgs;
use crate::avatar::{AvatarOptions, PAGE, PLAYER, run};
use anyhow::Context;
use clap::Args;
use std::path::{Path, PathBuf};
use yoto_import::Format;
use yoto_proto::pose_track::FILES;
use yoto_proto::v1::TrainSpec;
use yoto_terminal::output;

const AFTER_HELP: &str = "\
Steps, with a service of its own:
  1. reads the clip, with poses and masks from a pose tool (--poses) or from the pose model, and
     tests the reading by projecting the body onto the masks;
  2. checks the capture (check/sheet.png shows it) and stops if a measure fails;
  3. uploads it, trains, renders the person from all around and in a motion; index.html shows the
     training while it goes on;
  4. writes index.html and play.html, for browsers, report.html to send, report.json, and log.txt with all
     notes.

The clip shows one person, whole, from head to feet. Best is one slow turn with the arms out, then
down. Pose tools and their files: docs/use/pose-tools.md. The pose model: deploy/models/README.md.

Examples:
  yoto avatar walk.mp4 --pose-model models
  yoto avatar walk.mp4 --pose-model models --matting-model modnet.onnx
  yoto avatar walk.mp4 --poses wham_output.pkl --masks masks/
  yoto avatar walk.mp4 --poses demo_walk.pkl --person 2 --size 256 --seconds 600 --out out/walk
  yoto avatar captures/ada --range 0..100 --motion-file dance.bvh";

/// Make one person's avatar from a video: import, check, train, render, a page for the browser.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Avatar {
    /// The video, a folder of pictures, or a capture.
    #[arg(value_name = "CLIP")]
    source: PathBuf,
    /// Folder for everything that is made [default: out/ and the clip's name].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Name of the person [default: the clip's].
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    /// Format of the clip and its poses.
    #[arg(long, value_name = "FORMAT", default_value = "auto")]
    from: Format,
    /// Frames to use, by position, e.g. 0..300:2 or ..100 [default: all].
    #[arg(long = "range", value_name = "A..B:STEP")]
    frames: Option<FrameRange>,
    #[command(flatten)]
    clip: ClipMasks,
    #[command(flatten)]
    import: ImportOptions,
    /// Longest side of training images and renders, pixels [default: the side at which the person is 512 pixels long,
    /// at most the clip's and at most 1024].
    #[arg(long, value_name = "PX", value_parser = clap::value_parser!(u32).range(16..=1024))]
    size: Option<u32>,
    /// Seconds of training.
    #[arg(long, value_name = "S", default_value = "120", value_parser = args::seconds)]
    seconds: f64,
    #[command(flatten)]
    train: TrainArgs,
    /// Motion to render: BVH, AMASS-style .npz, or a pose track [default: one of yoto's own].
    #[arg(long, value_name = "FILE")]
    motion_file: Option<PathBuf>,
    /// Joint names of a BVH motion file, as JSON; `yoto motion --write-map` writes one to edit.
    #[arg(long, value_name = "FILE", requires = "motion_file")]
    joint_map: Option<PathBuf>,
    /// Train even if the check of the capture fails.
    #[arg(long)]
    despite_check: bool,
    /// Open the page in a browser as soon as the training begins.
    #[arg(long)]
    open: bool,
    /// Print all notes; log.txt has them in any case.
    #[arg(short, long)]
    pub(crate) verbose: bool,
}

impl Avatar {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        let source = std::fs::canonicalize(&self.source)
            .with_context(|| format!("reading {}", self.source.display()))?;
        let stem = source.file_stem().unwrap_or_default().to_string_lossy();
        let is_capture = |folder: &Path| FILES.iter().any(|name| folder.join(name).is_file());
        let stem = if stem == "video" && source.parent().is_some_and(is_capture) {
            // A capture's own name is its folder's.
            let folder = source.parent().and_then(|it| it.file_name());
            folder.unwrap_or_default().to_string_lossy()
        } else {
            stem
        };
        let out = self
            .out
            .unwrap_or_else(|| PathBuf::from("out").join(&*stem));
        let motion = match &self.motion_file {
            Some(file) => Some(
                MotionArgs::of_joints(self.joint_map, self.import.keeps_skeleton()).read(file)?,
            ),
            None => None,
        };
        let options = AvatarOptions {
            source: self.source,
            format: self.from,
            import: self.import.options(self.frames, self.clip.path()),
            name: self.name.unwrap_or_else(|| stem.to_string()),
            out,
            size: self.size,
            train: TrainSpec {
                seconds: self.seconds,
                ..self.train.spec()
            },
            motion,
            despite_check: self.despite_check,
            open: self.open,
        };
        let report = run(&options).await?;
        output::put("report", serde_json::to_value(&report)?);
        let training = report.training.iter();
        for (inside, whole) in training.filter_map(|it| it.psnr_box.zip(it.psnr)) {
            say!(
                "quality (PSNR on frames held out of training): {inside:.2} dB in the person's box, {whole:.2} dB \
                 over whole pictures"
            );
        }
        let pages = [PAGE, PLAYER].map(|name| options.out.join(name));
        output::put("files", output::paths(&pages));
        pages.iter().for_each(|page| say!("{}", page.display()));
        Ok(())
    }
}
