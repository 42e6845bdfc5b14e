//! Inputs that an importer can't find in the files, and which frames are taken.

use crate::source::Source;
use crate::{ImportError, MattingModel, PointRotation, PointSet, Progress};
use std::num::NonZeroUsize;
use std::path::PathBuf;
use yoto_media::video::Hdr;
use yoto_proto::pose_track::MAX_FRAMES;

/// Frames per second where neither the files nor the user give them.
const ASSUMED_FPS: f64 = 30.0;

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
    /// The set of key points, if the files don't tell.
    pub points: Option<PointSet>,
    /// The rotation of the pictures that a detector of key points saw.
    pub point_rotation: Option<PointRotation>,
    /// Whether the pictures that a detector of key points saw were mirrored.
    pub mirror_points: bool,
    /// Focal length of the clip's camera, pixels.
    pub focal: Option<f64>,
    /// The person's height, metres.
    pub height: Option<f64>,
    /// Files of the pose model: a file, or the folder that has them.
    pub pose_model: Option<PathBuf>,
    /// Whether the pose model alone looks at hands, without the model of hands.
    pub no_hands: bool,
    /// Whether the pose model alone looks at the face, without the model of faces.
    pub no_face: bool,
    /// Number of frames to keep: the best of the clip, by pose, view and sharpness.
    pub best: Option<NonZeroUsize>,
    /// Whether the tool's own joint hierarchy is kept, in place of SMPL's.
    pub keep_skeleton: bool,
    /// The light of the clip's levels.
    pub hdr: Hdr,
    /// The ffmpeg for videos other than H.264 in MP4 or MOV; the one in PATH if absent.
    pub ffmpeg: Option<PathBuf>,
    /// Receives the progress.
    pub progress: Progress,
}

impl Options {
    /// Positions of the selected frames among `count`.
    pub(crate) fn positions(
        &self,
        source: &Source,
        file: &str,
        count: usize,
    ) -> Result<Vec<usize>, ImportError> {
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
    pub(crate) fn beyond_last(&self, available: usize) -> Option<String> {
        let (_, end, _) = self.frames?;
        (end != u32::MAX as usize && end > available)
            .then(|| format!("the range goes to frame {end}, and there are {available} frames"))
    }

    /// Frames per second: the user's, those of the file, or [`ASSUMED_FPS`] with a note.
    pub(crate) fn fps_or(&self, of_file: Option<f64>, notes: &mut Vec<String>) -> f64 {
        self.fps.or(of_file).unwrap_or_else(|| {
            notes.push(format!(
                "no file has the frame rate: {ASSUMED_FPS} frames per second are assumed (--fps)"
            ));
            ASSUMED_FPS
        })
    }
}
