//! `yoto import`: captures of other programs as capture folders.

use crate::args::capture::{ClipMasks, ImportOptions};
use crate::args::frame_range::FrameRange;
use clap::Args;
use std::path::PathBuf;
use yoto_import::{Format, TrackForm, options_by_format};
use yoto_terminal::output;

const AFTER_HELP: &str = "\
Files of each format, with their units, are described in docs/use/formats.md. Shape parameters become
rest joints through your own copy of SMPL's body model, whose licence excludes it from this project.

Poses of a video alone are found by a pose model that deploy/models/get.sh fetches (see
deploy/models/README.md). So are its masks, unless --masks has better ones, or --matting-model makes
them: a network of yours in ONNX (docs/use/pose-tools.md#masks).

Poses of a video by 4D-Humans, WHAM, GVHMR, TRAM, ROMP, PromptHMR, LHM, ExAvatar or EasyMocap are
recognised by their contents, and checked against masks: see docs/use/pose-tools.md.

Examples:
  yoto import walk.mp4 --pose-model models --out captures/walk
  yoto import walk.mp4 --pose-model models --matting-model modnet.onnx --out captures/walk
  yoto import walk.mp4 --poses outputs/results/demo_walk.pkl --out captures/walk
  yoto import walk.mp4 --poses hmr4d_results.pt --masks masks/ --smpl SMPLX_NEUTRAL.npz \\
      --out captures/walk
  yoto import --from zju CoreView_377 --smpl SMPL_NEUTRAL.npz --range 0..570 --out captures/377
  yoto import --from humannerf dataset/zju_mocap/387 --out captures/387
  yoto import --from people-snapshot female-3-casual --smpl SMPL_FEMALE.pkl --out captures/f3c
  yoto import --from instant-avatar data/custom/ada --smpl SMPL_FEMALE.npz --poses poses/train.npz \\
      --range 0..200:2 --out captures/ada
  yoto import --from people-snapshot male-1 --smpl SMPL_MALE.pkl --best 60 --out captures/m1
  yoto import --from folder captures/ada --binary --out captures/ada-pb";

/// The examples, after what each format reads.
fn after_help() -> String {
    format!("{}\n{AFTER_HELP}", options_by_format())
}

/// Convert a capture of another program to a capture folder.
#[derive(Debug, Args)]
#[command(after_help = after_help())]
pub(crate) struct Import {
    /// The capture: a folder; or a video or a folder of pictures, with poses from --poses or from --pose-model.
    #[arg(value_name = "SRC")]
    source: PathBuf,
    /// Folder for the pose track, the frames and the masks.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Format of the capture, or the tool that wrote --poses.
    #[arg(long, value_name = "FORMAT", default_value = "auto")]
    from: Format,
    /// Write the pose track as protocol buffers (poses.pb) in place of JSON.
    #[arg(long)]
    binary: bool,
    /// Frames to import, by position, e.g. 0..570:2 or ..100 [default: all].
    #[arg(long = "range", alias = "frames", value_name = "A..B:STEP")]
    frames: Option<FrameRange>,
    #[command(flatten)]
    clip: ClipMasks,
    #[command(flatten)]
    what: ImportOptions,
}

impl Import {
    pub(crate) fn run(self) -> anyhow::Result<()> {
        let form = if self.binary {
            TrackForm::Binary
        } else {
            TrackForm::Json
        };
        self.what.import(
            self.from,
            &self.source,
            &self.out,
            form,
            self.frames,
            self.clip.path(),
        )?;
        say!("{}", self.out.display());
        output::put("files", output::paths(&[&self.out]));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::AFTER_HELP;
    use yoto_import::pose_tools;

    #[test]
    fn the_help_names_every_pose_tool() {
        for (_, name) in pose_tools() {
            let short = name.split(' ').next().unwrap_or(name);
            assert!(AFTER_HELP.contains(short), "{short}");
        }
    }
}
