//! Motions for animation: AMASS-style `.npz`, BVH, and pose tracks.
//!
//! A [`Motion`] always has y up, rotations local to the parent with a T-pose at rest facing +z,
//! joints with the names of people's skeletons, and the root's positions. Its unit of length does
//! not matter: strides are scaled by the height of the body's hips.

mod bvh;
mod joint_map;
mod kept;
mod smpl;
mod standing;

pub(super) use bvh::read_up as read_bvh;
pub use joint_map::{DEFAULT as DEFAULT_JOINT_MAP, JointMap};

use crate::BodyModel;
use crate::geometry::{IDENTITY_ROTATION, Mat3, Vec3, about_axis, add, sub};
use crate::source::Source;
use std::f64::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};
use yoto_capture::skeleton::{Pose, timing};
use yoto_client::ClientError;
use yoto_proto::pose_track::{MAX_FRAMES, PoseTrack, Skeleton, describe};
use yoto_proto::v1;

/// Up axis of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Up {
    /// y.
    Y,
    /// z, as in AMASS.
    Z,
}

impl Up {
    /// The rotation of positions with this axis up to those with y up.
    pub(super) fn to_y(self) -> Mat3 {
        match self {
            Self::Y => IDENTITY_ROTATION,
            Self::Z => about_axis(0, -FRAC_PI_2),
        }
    }
}

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
/// [`ClientError::BadCapture`] with file, frame and field.
pub fn read(path: &Path, options: &MotionOptions) -> Result<Motion, ClientError> {
    if !path.is_file() {
        return Err(ClientError::Name(format!(
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
        ClientError::BadCapture { violations, .. } => {
            let faults: Vec<String> = violations.iter().map(describe).collect();
            ClientError::Name(faults.join("\n"))
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
        "json" | "pb" => track(&source, &name),
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

/// The motion of a capture, with poses at equal times.
fn track(source: &Source, name: &str) -> Result<Motion, ClientError> {
    let bytes = source.bytes(name, None)?;
    let track = PoseTrack::from_file(name, &bytes).map_err(|found| source.bad(found))?;
    let rest = track.skeleton.rest_joints.first().copied();
    let rest = rest.unwrap_or_default();
    let poses = track.frames.iter().map(|frame| {
        Pose::from_frame(frame).map_err(|error| {
            source.fault(
                "INVALID",
                name,
                Some(frame.index),
                &error.field,
                &error.message,
            )
        })
    });
    let poses = poses.collect::<Result<Vec<_>, _>>()?;
    let numbers: Vec<u32> = track.frames.iter().map(|frame| frame.index).collect();
    let (poses, fps) = timing::even(poses, &numbers, track.fps);
    let frame = |pose: &Pose| MotionFrame {
        rotations: pose.rotations_f64(),
        root: add(rest, pose.translation.map(f64::from)),
    };
    let names = track.skeleton.names.iter();
    Ok(Motion {
        frames: poses.iter().map(frame).collect(),
        fps,
        matched: names.map(|name| (name.clone(), name.clone())).collect(),
        unmatched: Vec::new(),
        notes: vec!["a capture does not say which way is up: y is assumed".into()],
        skeleton: track.skeleton,
    })
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
    fn rest_joints(&self, betas: &[f64]) -> Result<Option<Vec<Vec3>>, ClientError> {
        match &self.body_model {
            Some(path) => Ok(Some(BodyModel::open(path)?.joints(betas))),
            None => Ok(None),
        }
    }
}
