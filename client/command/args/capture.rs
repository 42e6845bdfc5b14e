//! Inputs that an importer of captures can't find in the files.

use crate::args::MattingArgs;
use crate::args::frame_range::FrameRange;
use crate::import_progress;
use clap::{Args, ValueEnum};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use yoto_import::{FfmpegArg, Format, Options, PointRotation, PointSet, TrackForm, to_folder};
use yoto_media::video::Hdr;

/// Masks of a clip whose poses a pose tool or the pose model found.
#[derive(Debug, Args)]
pub(crate) struct ClipMasks {
    /// Masks of a clip: a folder of images, or a video [default: the pose tool's, or the pose
    /// model's].
    #[arg(long, value_name = "PATH")]
    masks: Option<PathBuf>,
}

impl ClipMasks {
    /// The folder or video, if one was named.
    pub(crate) fn path(&self) -> Option<&Path> {
        self.masks.as_deref()
    }
}

/// The light of a clip's levels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum HdrArg {
    Auto,
    Off,
    Hlg,
    Pq,
}

/// Inputs that an importer can't find in the files.
#[derive(Debug, Args)]
pub(crate) struct ImportOptions {
    /// Your copy of SMPL's body model (.npz or .pkl), for rest joints.
    #[arg(long, value_name = "FILE", env = "YOTO_SMPL")]
    smpl: Option<PathBuf>,
    /// The 24 rest joints themselves (JSON or pickle), in place of a body model.
    #[arg(long, value_name = "FILE")]
    rest_joints: Option<PathBuf>,
    /// Camera of a rig, counted from 0 [default: 0].
    #[arg(long, value_name = "N")]
    view: Option<usize>,
    /// File of poses: one of several in the capture, or the output of a pose tool.
    #[arg(long, value_name = "PATH")]
    poses: Option<PathBuf>,
    /// The person, by their number or name in the files, or for a clip alone by their number in the picture of people
    /// [default: the person whom the masks show, or who is in most frames].
    #[arg(long, value_name = "ID")]
    person: Option<String>,
    /// The set of key points, if the file doesn't tell.
    #[arg(long, value_name = "SET")]
    points: Option<PointSet>,
    /// Turn key points back: their detector saw the clip turned clockwise by these degrees.
    #[arg(long, value_name = "DEG")]
    point_rotation: Option<PointRotation>,
    /// Mirror key points, left for right: their detector saw the clip mirrored.
    #[arg(long)]
    mirror_points: bool,
    /// Focal length of the clip's camera, pixels [default: found, or the pose tool's].
    #[arg(long, value_name = "PX", value_parser = focal)]
    focal: Option<f64>,
    /// Height of the person, metres, if nothing else gives a scale.
    #[arg(long, value_name = "M", value_parser = height)]
    height: Option<f64>,
    /// Keep the tool's own skeleton in place of SMPL's 24 joints: for SAM 3D Body (MHR) and BVH files.
    #[arg(long)]
    keep_skeleton: bool,
    /// The pose model: a file, or the folder that deploy/models/get.sh filled.
    #[arg(long, value_name = "PATH", env = "YOTO_POSE_MODEL")]
    pose_model: Option<PathBuf>,
    /// Read hands of a clip alone by the pose model, without the model of hands: fingers stay as they are at rest.
    #[arg(long)]
    no_hands: bool,
    /// Read the face of a clip alone by the pose model, without the model of faces: mouth and eyelids stay at rest.
    #[arg(long)]
    no_face: bool,
    /// Frames per second, if no file tells them.
    #[arg(long, value_name = "RATE", value_parser = rate)]
    fps: Option<f64>,
    /// Levels of the clip: as its file declares (auto), ordinary video (off), HLG or PQ. With any value but auto, the
    /// pictures of the capture are written again.
    #[arg(long, value_enum, value_name = "KIND", default_value = "auto")]
    hdr: HdrArg,
    /// Keep the N sharp frames that differ most in pose and view. All pictures are decoded for this.
    #[arg(long, value_name = "N", value_parser = frame_count)]
    best: Option<NonZeroUsize>,
    #[command(flatten)]
    matting: MattingArgs,
    #[command(flatten)]
    ffmpeg: FfmpegArg,
}

/// Highest rate of a pose track, frames per second.
const MAX_FPS: f64 = 1000.0;

/// Parses a focal length.
fn focal(text: &str) -> Result<f64, String> {
    let value: Option<f64> = text.parse().ok();
    value
        .filter(|value| (1.0..=1e6).contains(value))
        .ok_or_else(|| "a focal length is 1 to 1000000 pixels".to_owned())
}

/// Parses a frame rate.
fn rate(text: &str) -> Result<f64, String> {
    let value: Option<f64> = text.parse().ok();
    value
        .filter(|value| *value > 0.0 && *value <= MAX_FPS)
        .ok_or_else(|| format!("a rate is above 0 and at most {MAX_FPS} frames per second"))
}

/// Parses a number of frames to keep.
fn frame_count(text: &str) -> Result<NonZeroUsize, String> {
    text.parse()
        .map_err(|_| "a whole number of frames is needed, at least 1".to_owned())
}

/// Parses a person's height.
fn height(text: &str) -> Result<f64, String> {
    let value: Option<f64> = text.parse().ok();
    value
        .filter(|value| (0.3..=3.0).contains(value))
        .ok_or_else(|| "a height is 0.3 to 3 metres".to_owned())
}

impl ImportOptions {
    /// Whether any option was given.
    pub(crate) fn any(&self) -> bool {
        // A body model may come from the environment, for all commands.
        self.rest_joints.is_some()
            || self.view.is_some()
            || self.poses.is_some()
            || self.fps.is_some()
            || self.person.is_some()
            || self.points.is_some()
            || self.point_rotation.is_some()
            || self.mirror_points
            || self.focal.is_some()
            || self.height.is_some()
            || self.keep_skeleton
            || self.no_hands
            || self.no_face
            || self.hdr != HdrArg::Auto
            || self.best.is_some()
            || self.matting.model().is_some()
    }

    /// Whether the tool's own tree of joints is kept.
    #[cfg(feature = "embedded")]
    pub(crate) fn keeps_skeleton(&self) -> bool {
        self.keep_skeleton
    }

    /// These inputs, `frames` by position and `masks` of the clip, for an importer.
    pub(crate) fn options(&self, frames: Option<FrameRange>, masks: Option<&Path>) -> Options {
        let range = |range: FrameRange| {
            (
                range.first as usize,
                range.end as usize,
                range.step as usize,
            )
        };
        Options {
            body_model: self.smpl.clone(),
            rest_joints: self.rest_joints.clone(),
            camera: self.view,
            poses: self.poses.clone(),
            fps: self.fps,
            frames: frames.map(range),
            masks: masks.map(Path::to_owned),
            matting: self.matting.model(),
            person: self.person.clone(),
            points: self.points,
            point_rotation: self.point_rotation,
            mirror_points: self.mirror_points,
            focal: self.focal,
            height: self.height,
            keep_skeleton: self.keep_skeleton,
            pose_model: self.pose_model.clone(),
            no_hands: self.no_hands,
            no_face: self.no_face,
            best: self.best,
            hdr: match self.hdr {
                HdrArg::Auto => Hdr::Auto,
                HdrArg::Off => Hdr::Off,
                HdrArg::Hlg => Hdr::Hlg,
                HdrArg::Pq => Hdr::Pq,
            },
            ffmpeg: self.ffmpeg.program().map(Path::to_owned),
            progress: import_progress::on_terminal(),
        }
    }

    /// Reads the `frames` of the capture in `source`, by position, with the clip's `masks`, and writes
    /// them to `out`, showing the progress.
    pub(crate) fn import(
        &self,
        format: Format,
        source: &Path,
        out: &Path,
        form: TrackForm,
        frames: Option<FrameRange>,
        masks: Option<&Path>,
    ) -> anyhow::Result<()> {
        to_folder(format, source, out, form, &self.options(frames, masks))?;
        Ok(())
    }
}
