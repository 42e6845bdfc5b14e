//! Captures as folders, and captures and motions of other programs.
//!
//! [`capture_dir`] is a capture as a folder on disk before it is uploaded, [`capture_check`] tells
//! whether its poses, cameras, masks and pictures agree.
//!
//! One file per format; each reads its program's files and documents their conventions: units,
//! direction of extrinsics, pixel centres, meaning of the root's translation. All of them give the
//! one schema of the service ([`PoseTrack`](yoto_proto::pose_track::PoseTrack)). [`write`] writes a
//! capture folder; [`motion`] reads motions for animation.
//!
//! ```text
//! source (bytes → plain data) → zju | humannerf | … (→ pose track + pictures) → write (folder)
//!     clip (video or pictures) → pose_tools ┤
//!                              → film ──────┘
//!                   matting (→ masks) ┘
//! ```

mod auto;
pub mod best;
mod body_model;
mod bvh_clip;
pub mod capture_check;
pub mod capture_dir;
mod capture_frames;
mod clip;
mod datasets;
mod features;
mod film;
mod geometry;
mod given;
mod key_points;
mod matting;
pub mod motion;
mod pictures;
mod pose_tools;
mod rest_joints;
mod source;
mod to_folder;
mod track;
mod tree;
mod write;

pub use body_model::BodyModel;
pub use capture_frames::CaptureFrames;
pub use given::options_by_format;
#[cfg(feature = "hdf5")]
pub use source::hdf5::MaskStack;
pub use matting::{Levels, MattingModel};
pub use pictures::{Mask, MaskKind, PictureFiles, Pictures};
pub use to_folder::to_folder;
pub use write::{TrackForm, VIDEO, ensure_no_capture, write, write_images};

use auto::Recognised;
use datasets::{folder, humannerf_prepared, humannerf_wild, instant_avatar, people_snapshot, zju};
use pose_tools::Tool;
use rest_joints::RestJoints;
use source::Source;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use yoto_client::ClientError;
use yoto_proto::pose_track::{MAX_FRAMES, PoseTrack};

/// Format of a capture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// Recognised by the files.
    #[default]
    Auto,
    /// ZJU-MoCap in EasyMocap's layout: annots.npy, new_params, images, mask, mask_cihp.
    Zju,
    /// HumanNeRF: metadata.json of a wild video, or the prepared cameras.pkl, mesh_infos.pkl
    /// and canonical_joints.pkl.
    #[value(name = "humannerf")]
    HumanNerf,
    /// PeopleSnapshot: camera.pkl, masks.hdf5, reconstructed_poses.hdf5 and a video.
    PeopleSnapshot,
    /// InstantAvatar: cameras.npz, poses.npz or poses/*.npz, images, masks.
    InstantAvatar,
    /// This project's own: poses.json or poses.pb, frames, masks.
    Folder,
    /// A video, or a folder of pictures, alone: poses and masks by --pose-model.
    Film,
    /// 4D-Humans' tracker PHALP: --poses outputs/results/demo_*.pkl, with its video.
    Phalp,
    /// WHAM: --poses wham_output.pkl, with its video.
    Wham,
    /// GVHMR: --poses hmr4d_results.pt, with its video.
    Gvhmr,
    /// TRAM: --poses results/CLIP, with its video.
    Tram,
    /// ROMP or BEV: --poses a folder of *.npz or video_results.npz, with its video.
    Romp,
    /// PromptHMR: --poses results.pkl, with its video.
    #[value(name = "prompthmr")]
    PromptHmr,
    /// LHM's motions: --poses smplx_params, with their video.
    Lhm,
    /// ExAvatar: --poses smplx_optimized/smplx_params, with the pictures or their video.
    #[value(name = "exavatar")]
    ExAvatar,
    /// EasyMocap: --poses a folder with smpl, intri.yml and extri.yml, with one view's video.
    #[value(name = "easymocap")]
    EasyMocap,
    /// BVH: --poses a .bvh, with the clip that it is of; intri.yml and extri.yml beside it for the camera.
    Bvh,
    /// Key points of OpenPose, AlphaPose, MMPose, easy_ViTPose, MediaPipe or SAM 3D Body: --poses
    /// their files, with the clip; a body is fitted to them.
    KeyPoints,
}

/// Inputs that an importer can't find in the files.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// A body model of SMPL (`.npz` or `.pkl`), for rest joints of shape parameters.
    pub body_model: Option<PathBuf>,
    /// Rest joints themselves (JSON or pickle), in place of a body model.
    pub rest_joints: Option<PathBuf>,
    /// Camera of a rig; 0 by default.
    pub camera: Option<usize>,
    /// File of poses, if there are several.
    pub poses: Option<PathBuf>,
    /// Frames per second, if no file has it.
    pub fps: Option<f64>,
    /// Frames to take, by position in the source: first, end (exclusive), step.
    pub frames: Option<(usize, usize, usize)>,
    /// Masks of the clip: a folder of images or a video.
    pub masks: Option<PathBuf>,
    /// A matting model that makes the masks of a clip.
    pub matting: Option<MattingModel>,
    /// The person to take, by the name or number that the files give.
    pub person: Option<String>,
    /// Focal length of the clip's camera, pixels.
    pub focal: Option<f64>,
    /// The person's height, metres.
    pub height: Option<f64>,
    /// Files of the pose model: a file, or the folder that has them.
    pub pose_model: Option<PathBuf>,
    /// Number of frames to keep: those that teach most.
    pub best: Option<NonZeroUsize>,
    /// Whether the tool's own tree of joints is kept, in place of SMPL's.
    pub keep_skeleton: bool,
    /// The ffmpeg for videos other than H.264 in MP4 or MOV; the one in PATH if absent.
    pub ffmpeg: Option<PathBuf>,
}

impl Options {
    /// Positions of the selected frames among `count`.
    fn positions(
        &self,
        source: &Source,
        file: &str,
        count: usize,
    ) -> Result<Vec<usize>, ClientError> {
        let (first, end, step) = self.frames.unwrap_or((0, count, 1));
        let wanted: Vec<usize> = (first..end.min(count)).step_by(step.max(1)).collect();
        if wanted.is_empty() || wanted.len() > MAX_FRAMES {
            let message = format!(
                "{} of {count} frames are chosen: 1 to {MAX_FRAMES} are allowed",
                wanted.len()
            );
            return Err(source.fault("OUT_OF_RANGE", file, None, "frames", message));
        }
        Ok(wanted)
    }

    /// A note about a range that goes beyond the `available` frames. Frames that are left out for
    /// other reasons have notes of their own.
    fn beyond_last(&self, available: usize) -> Option<String> {
        let (_, end, _) = self.frames?;
        (end != u32::MAX as usize && end > available)
            .then(|| format!("the range goes to frame {end}, and there are {available} frames"))
    }

    /// The user's value, or `assumed` with a note.
    fn fps_or(&self, assumed: f64, notes: &mut Vec<String>) -> f64 {
        self.fps.unwrap_or_else(|| {
            notes.push(format!(
                "no file says how fast the frames are: {assumed} a second (--fps)"
            ));
            assumed
        })
    }
}

/// A capture after reading, before writing.
#[derive(Clone, Debug)]
pub struct Imported {
    /// Poses and cameras of each frame; indices are those of the files to write.
    pub track: PoseTrack,
    /// The pictures of each frame, in the track's order.
    pub pictures: Pictures,
    /// Frames that the source has, of which a range selects some.
    pub available: usize,
    /// Assumptions, for people to read.
    pub notes: Vec<String>,
}

/// Reads the capture in `dir`, without decoding its pictures.
///
/// # Errors
/// [`ClientError::BadCapture`] with file, frame and field; [`ClientError::File`] when the file
/// system fails.
pub fn read(format: Format, dir: &Path, options: &Options) -> Result<Imported, ClientError> {
    let source = Source::new(dir);
    features::ensure_built(options)?;
    if format != Format::Auto {
        given::ensure_read(format, dir, options)?;
    }
    let tool = |tool| pose_tools::read(dir, options, Some(tool));
    let imported = match format {
        Format::Auto => {
            return match auto::recognise(dir, options)? {
                Recognised::Capture(format, name) => {
                    let mut imported = read(format, dir, options)?;
                    imported.notes.insert(0, format!("recognised: {name}"));
                    Ok(imported)
                }
                Recognised::KeyPoints => read(Format::KeyPoints, dir, options),
                Recognised::PoseTool => {
                    checked(&source, pose_tools::read(dir, options, None)?, options)
                }
            };
        }
        Format::Zju => zju::read(&source, options),
        Format::HumanNerf if source.has("metadata.json") && !source.has("mesh_infos.pkl") => {
            humannerf_wild::read(&source, options)
        }
        Format::HumanNerf => humannerf_prepared::read(&source, options),
        Format::PeopleSnapshot => people_snapshot::read(&source, options),
        Format::InstantAvatar => instant_avatar::read(&source, options),
        Format::Folder => folder::read(&source, options),
        Format::Film => film::read(dir, options),
        Format::Phalp => tool(Tool::Phalp),
        Format::Wham => tool(Tool::Wham),
        Format::Gvhmr => tool(Tool::Gvhmr),
        Format::Tram => tool(Tool::Tram),
        Format::Romp => tool(Tool::Romp),
        Format::PromptHmr => tool(Tool::PromptHmr),
        Format::Lhm => tool(Tool::Lhm),
        Format::ExAvatar => tool(Tool::ExAvatar),
        Format::EasyMocap => tool(Tool::EasyMocap),
        Format::Bvh => bvh_clip::read(dir, options),
        Format::KeyPoints => key_points::read(dir, options),
    }?;
    checked(&source, imported, options)
}

/// `imported`, if its track has no faults, with a note about frames that it lacks.
fn checked(
    source: &Source,
    mut imported: Imported,
    options: &Options,
) -> Result<Imported, ClientError> {
    imported
        .notes
        .extend(options.beyond_last(imported.available));
    let violations = imported.track.check();
    if violations.is_empty() {
        Ok(imported)
    } else {
        Err(source.bad(violations))
    }
}
