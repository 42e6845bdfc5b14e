//! Pictures that training never sees: the `eval` and `eval_pose` parts of a capture folder.

use super::files::{at_fault, read_frame};
use super::{CaptureError, FrameImage};
use crate::ViewError;
use crate::camera::Camera;
use crate::skeleton::Pose;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use yoto_proto::pose_track::{self, PoseTrack};

/// Name of the training frames' camera.
const TRAIN: &str = "train";

/// The parts of `poses.json` beyond the pose track.
#[derive(Debug, Deserialize)]
pub(super) struct HeldOut {
    /// Coordinate of the first pixel's centre in the file; 0.5 in memory, as in the track.
    #[serde(default = "half")]
    pixel_centre: f64,
    #[serde(default)]
    eval: BTreeMap<String, EvalCamera>,
    #[serde(default)]
    eval_pose: EvalPose,
}

impl Default for HeldOut {
    fn default() -> Self {
        Self {
            pixel_centre: half(),
            eval: BTreeMap::new(),
            eval_pose: EvalPose::default(),
        }
    }
}

fn half() -> f64 {
    0.5
}

#[derive(Debug, Deserialize)]
struct EvalCamera {
    #[serde(flatten)]
    matrices: Matrices,
    frames: Vec<u32>,
}

#[derive(Debug, Deserialize)]
struct Matrices {
    #[serde(rename = "K")]
    k: [[f64; 3]; 3],
    #[serde(rename = "E")]
    e: [[f64; 4]; 4],
}

#[derive(Debug, Default, Deserialize)]
struct EvalPose {
    #[serde(default)]
    frames: Vec<EvalFrame>,
    #[serde(default)]
    cams: BTreeMap<String, Matrices>,
}

#[derive(Debug, Deserialize)]
struct EvalFrame {
    index: u32,
    pose: Vec<f64>,
    translation: [f64; 3],
}

/// A picture that training never sees.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldOutView {
    /// Name of the camera and of its folder.
    pub camera_name: String,
    /// Number in the file names.
    pub frame: u32,
    /// The person's pose.
    pub pose: Pose,
    /// The camera, at the stored images' size.
    pub camera: Camera,
    /// The picture's file.
    pub frame_path: PathBuf,
    /// The file of its coverage mask.
    pub mask_path: PathBuf,
    /// File names for errors, relative to the capture.
    names: (String, String),
}

impl HeldOutView {
    /// Decodes the picture.
    ///
    /// # Errors
    /// The same errors as [`FrameImage::decode`], and when a file is missing or can't be read.
    pub fn read(&self) -> Result<FrameImage, CaptureError> {
        read_frame(
            (&self.frame_path, &self.mask_path),
            (&self.names.0, &self.names.1),
            [self.camera.width, self.camera.height],
            self.frame,
        )
    }
}

impl HeldOut {
    /// Reads the held-out parts of a `poses.json`; both may be absent.
    pub(super) fn from_json(bytes: &[u8]) -> Result<Self, CaptureError> {
        let mut read: Self = serde_json::from_slice(bytes).map_err(|error| {
            let position = format!("line {} column {}", error.line(), error.column());
            at_fault(position, error.to_string())
        })?;
        let shift = half() - read.pixel_centre;
        let seen = read.eval.values_mut().map(|camera| &mut camera.matrices);
        for camera in seen.chain(read.eval_pose.cams.values_mut()) {
            camera.k[0][2] += shift;
            camera.k[1][2] += shift;
        }
        read.pixel_centre = half();
        Ok(read)
    }

    /// Whether there are no held-out pictures.
    pub(super) fn is_empty(&self) -> bool {
        self.eval.is_empty() && self.eval_pose.cams.is_empty()
    }

    /// The cameras of held-out views and held-out poses by name, for pictures of `image_size`.
    pub(super) fn cameras(
        &self,
        image_size: [u32; 2],
    ) -> Result<BTreeMap<String, Camera>, CaptureError> {
        let eval = self
            .eval
            .iter()
            .map(|(name, eval)| ("eval", name, &eval.matrices));
        let poses = self.eval_pose.cams.iter();
        let poses = poses.map(|(name, matrices)| ("eval_pose.cams", name, matrices));
        let mut cameras = BTreeMap::new();
        for (field, name, matrices) in poses.chain(eval) {
            cameras.insert(name.clone(), camera_of(field, name, matrices, image_size)?);
        }
        Ok(cameras)
    }

    /// The pose of `frame`, trained on or held out, and the camera called `name`. The camera of the
    /// training frames is `train`.
    pub(super) fn find(
        &self,
        track: &PoseTrack,
        name: &str,
        frame: u32,
    ) -> Result<(Pose, Camera), CaptureError> {
        let trained = track.frames.iter().find(|f| f.index == frame);
        let unseen = self.eval_pose.frames.iter().find(|f| f.index == frame);
        let pose = match (trained, unseen) {
            (Some(frame), _) => Pose::from_frame(frame),
            (None, Some(frame)) => Pose::from_parts("pose", &frame.pose, frame.translation),
            (None, None) => {
                let message = format!("there is no frame {frame}, neither trained on nor held out");
                return Err(at_fault("frames", message));
            }
        }
        .map_err(|error| within(&format!("frame {frame}"), error))?;
        if let (TRAIN, Some(frame)) = (name, trained) {
            let camera = Camera::from_frame(frame, track.image_size)
                .map_err(|error| within(&format!("frame {}", frame.index), error))?;
            return Ok((pose, camera));
        }
        let eval = self.eval.get(name).map(|eval| &eval.matrices);
        let eval_pose = self.eval_pose.cams.get(name);
        let matrices = if trained.is_some() {
            eval.or(eval_pose)
        } else {
            eval_pose.or(eval)
        };
        let matrices = matrices.ok_or_else(|| {
            let known = self.eval.keys().chain(self.eval_pose.cams.keys());
            let mut known: Vec<&str> = known.map(String::as_str).chain([TRAIN]).collect();
            known.sort_unstable();
            known.dedup();
            let message = format!(
                "no camera is called '{name}'; cameras: {}",
                known.join(", ")
            );
            at_fault("eval", message)
        })?;
        let camera = camera_of("eval", name, matrices, track.image_size)?;
        Ok((pose, camera))
    }

    /// Held-out views of training poses.
    pub(super) fn views(
        &self,
        root: &Path,
        track: &PoseTrack,
    ) -> Result<Vec<HeldOutView>, CaptureError> {
        let by_index: BTreeMap<u32, &pose_track::Frame> =
            track.frames.iter().map(|f| (f.index, f)).collect();
        let mut views = Vec::new();
        for (name, eval) in &self.eval {
            let camera = camera_of("eval", name, &eval.matrices, track.image_size)?;
            for &index in &eval.frames {
                let field = format!("eval.{name}.frames");
                let frame = by_index.get(&index).ok_or_else(|| {
                    at_fault(&field, format!("{index} is not a frame of this track"))
                })?;
                let pose = Pose::from_frame(frame).map_err(|error| within(&field, error))?;
                views.push(held_out(root, "eval", name, index, pose, camera.clone()));
            }
        }
        Ok(views)
    }

    /// Held-out poses.
    pub(super) fn poses(
        &self,
        root: &Path,
        track: &PoseTrack,
    ) -> Result<Vec<HeldOutView>, CaptureError> {
        let eval = &self.eval_pose;
        let mut views = Vec::new();
        for (name, matrices) in &eval.cams {
            let camera = camera_of("eval_pose.cams", name, matrices, track.image_size)?;
            for frame in &eval.frames {
                let field = format!("eval_pose.frames, index {}", frame.index);
                let pose = Pose::from_parts("pose", &frame.pose, frame.translation)
                    .map_err(|error| within(&field, error))?;
                if pose.rotations.len() != track.joints() {
                    let message = format!(
                        "{} rotations for {} joints",
                        pose.rotations.len(),
                        track.joints()
                    );
                    return Err(at_fault(field, message));
                }
                views.push(held_out(
                    root,
                    "eval_pose",
                    name,
                    frame.index,
                    pose,
                    camera.clone(),
                ));
            }
        }
        Ok(views)
    }
}

fn held_out(
    root: &Path,
    folder: &str,
    camera_name: &str,
    frame: u32,
    pose: Pose,
    camera: Camera,
) -> HeldOutView {
    let [image, mask] =
        ["frames", "masks"].map(|kind| format!("{folder}/{camera_name}/{kind}/{frame:06}.png"));
    HeldOutView {
        camera_name: camera_name.to_owned(),
        frame,
        pose,
        camera,
        frame_path: root.join(&image),
        mask_path: root.join(&mask),
        names: (image, mask),
    }
}

/// The camera called `name`. The name becomes part of a path, so it must be a plain one.
fn camera_of(
    field: &str,
    name: &str,
    matrices: &Matrices,
    image_size: [u32; 2],
) -> Result<Camera, CaptureError> {
    let field = format!("{field}.{name}");
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if name.is_empty() || !name.chars().all(plain) {
        let message = "camera names are letters, digits, _ and - (they name folders)";
        return Err(at_fault(field, message));
    }
    Camera::from_matrices(image_size, matrices.k, matrices.e).map_err(|error| within(&field, error))
}

fn within(field: &str, error: ViewError) -> CaptureError {
    at_fault(format!("{field}.{}", error.field), error.message)
}
