//! Options for reading a motion file.

use clap::Args;
use std::path::{Path, PathBuf};
use yoto_import::motion::{Motion, MotionOptions, Up};
use yoto_import::read_motion;

/// Options for reading a motion file.
#[derive(Debug, Args)]
pub(crate) struct MotionArgs {
    /// Joint names of BVH files, as JSON; `yoto motion --write-map` writes one to edit.
    #[arg(long, value_name = "FILE")]
    joint_map: Option<PathBuf>,
    /// Your copy of SMPL's body model (.npz or .pkl), for the legs' length in .npz motions.
    #[arg(long, value_name = "FILE", env = "YOTO_SMPL")]
    smpl: Option<PathBuf>,
    /// Up axis of a motion file, such as z or -y [default: the axis along which the person stands in the motion].
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true)]
    up: Option<Up>,
    /// Move the joints with the names of the BVH file, not SMPL's: for people whose captures keep the skeleton of
    /// that file.
    #[arg(long)]
    keep_skeleton: bool,
}

impl MotionArgs {
    /// Whether any option was given; a body model may come from the environment, for all commands.
    pub(crate) fn any(&self) -> bool {
        self.joint_map.is_some() || self.up.is_some() || self.keep_skeleton
    }

    /// No options.
    #[cfg(test)]
    pub(crate) fn none() -> Self {
        Self {
            joint_map: None,
            smpl: None,
            up: None,
            keep_skeleton: false,
        }
    }

    /// The joint map alone, and whether a BVH file moves joints with the names of its own skeleton.
    #[cfg(feature = "embedded")]
    pub(crate) fn of_joints(joint_map: Option<PathBuf>, keep_skeleton: bool) -> Self {
        Self {
            joint_map,
            smpl: None,
            up: None,
            keep_skeleton,
        }
    }

    /// Reads a motion and prints its assumptions.
    pub(crate) fn read(&self, file: &Path) -> anyhow::Result<Motion> {
        let options = MotionOptions {
            joint_map: self.joint_map.clone(),
            body_model: self.smpl.clone(),
            up: self.up,
            keep_skeleton: self.keep_skeleton,
        };
        let motion = read_motion(file, &options)?;
        for note in &motion.notes {
            tell!("note: {note}");
        }
        Ok(motion)
    }
}
