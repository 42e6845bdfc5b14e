//! Motions for animation: AMASS-style `.npz`, BVH, and pose tracks.
//!
//! A [`Motion`] always has y up, rotations local to the parent with a T-pose at rest facing +z,
//! joints with the names of people's skeletons, and the root's positions. Its unit of length does
//! not matter: strides are scaled by the height of the body's hips.

mod bvh;
mod gaps;
mod joint_map;
mod kept;
mod posture;
mod smpl;
mod smpl_parts;
mod standing;
mod track;
mod up;

pub(super) use bvh::read_up as read_bvh;
pub use joint_map::{DEFAULT as DEFAULT_JOINT_MAP, JointMap};
pub use up::Up;

use crate::geometry::{Vec3, sub};
use crate::source::Source;
use crate::{BodyModel, ImportError};
use std::path::{Path, PathBuf};
use yoto_proto::pose_track::{MAX_FRAMES, Skeleton, describe};
use yoto_proto::v1;

/// Inputs that a motion's file lacks.
#[derive(Clone, Debug, Default)]
pub struct MotionOptions {
    /// Names of joints; the default map if absent.
    pub joint_map: Option<PathBuf>,
    /// A body model of SMPL, for the rest joints of shape parameters.
    pub body_model: Option<PathBuf>,
    /// The up axis, if it is not the format's default.
    pub up: Option<Up>,
    /// Whether a BVH file's own joints are kept, in place of those that match SMPL's, under SMPL's names.
    pub keep_skeleton: bool,
}

/// A motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Skeleton of the motion. Rest joints are an empty list if the file has none: the motion then
    /// has the size of the body that it animates.
    pub skeleton: Skeleton,
    /// One row per frame.
    pub frames: Vec<MotionFrame>,
    /// Frames per second.
    pub fps: f64,
    /// Joints of the skeleton with the file's names for them.
    pub matched: Vec<(String, String)>,
    /// Joints of the file that move nothing.
    pub unmatched: Vec<String>,
    /// Assumptions.
    pub notes: Vec<String>,
}

/// A frame of a motion.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionFrame {
    /// Axis-angle of each joint, radians, local to the parent.
    pub rotations: Vec<Vec3>,
    /// Position of the root joint, y up.
    pub root: Vec3,
}

/// Reads a motion, by its file's extension: `.npz` (SMPL's parameters), `.bvh`, or a pose
/// track's `.json` or `.pb`.
///
/// # Errors
/// [`ImportError::BadCapture`] with file, frame and field.
pub fn read(path: &Path, options: &MotionOptions) -> Result<Motion, ImportError> {
    if !path.is_file() {
        return Err(ImportError::Unusable(format!(
            "there is no file {}",
            path.display()
        )));
    }
    let folder = path.parent().filter(|it| !it.as_os_str().is_empty());
    let source = Source::new(folder.unwrap_or(Path::new(".")));
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let ending = path.extension().and_then(|ending| ending.to_str());
    // A motion is no capture: its file is all that a fault has to name.
    let named = |error| match error {
        ImportError::BadCapture { violations, .. } => {
            let faults: Vec<String> = violations.iter().map(describe).collect();
            ImportError::Unusable(faults.join("\n"))
        }
        error => error,
    };
    let motion = match ending.unwrap_or_default().to_ascii_lowercase().as_str() {
        "bvh" => bvh::read(&source, &name, options),
        "npz" if options.keep_skeleton => {
            let message = "SMPL's parameters: their skeleton is SMPL's, and there is no other to keep \
                           (--keep-skeleton is for BVH)";
            Err(source.fault("UNREAD_OPTION", &name, None, "--keep-skeleton", message))
        }
        "npz" => smpl::read(&source, &name, options),
        "json" | "pb" => track::read(&source, &name, options),
        other => {
            let message = format!("'.{other}' is not a motion format: .bvh, .npz, .json or .pb");
            Err(source.fault("UNREADABLE", &name, None, "", message))
        }
    }
    .map_err(named)?;
    if motion.frames.is_empty() || motion.frames.len() > MAX_FRAMES {
        let message = format!(
            "{} frames: 1 to {MAX_FRAMES} are allowed",
            motion.frames.len()
        );
        return Err(source.fault("OUT_OF_RANGE", &name, None, "frames", message));
    }
    Ok(motion)
}

impl Motion {
    /// Frames first, first + step, … before end, in the form of requests; `size` is the longest
    /// side of the pictures, pixels.
    pub fn clip(&self, first: usize, end: usize, step: usize, size: u32) -> v1::MotionClip {
        let rest = self.skeleton.rest_joints.first().copied();
        let rest = rest.unwrap_or_default();
        let chosen = self
            .frames
            .iter()
            .take(end)
            .skip(first)
            .step_by(step.max(1));
        let pose = |frame: &MotionFrame| v1::BodyPose {
            rotations: frame
                .rotations
                .iter()
                .flatten()
                .map(|v| *v as f32)
                .collect(),
            translation: sub(frame.root, rest).iter().map(|v| *v as f32).collect(),
        };
        v1::MotionClip {
            skeleton: Some(self.skeleton.to_proto()),
            poses: chosen.map(pose).collect(),
            size,
            camera_frame: None,
            follow: false,
            fps: self.fps / step.max(1) as f64,
        }
    }
}

impl MotionOptions {
    fn rest_joints(&self, betas: &[f64]) -> Result<Option<Vec<Vec3>>, ImportError> {
        match &self.body_model {
            Some(path) => Ok(Some(BodyModel::open(path)?.joints(betas))),
            None => Ok(None),
        }
    }
}
