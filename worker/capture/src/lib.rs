//! Captures: people as cameras saw them, without any tensor library.
//!
//! A [`folder`] is what a user has; a [`shard`] is what ingest makes of it and training reads:
//! the same frames, decoded, checked, cropped to the person. [`skeleton`] and [`camera`] are the
//! geometry that every other part of the program shares, [`body_box`] the space around a posed
//! body that rays are cut to, and [`check`] the measures of a capture's quality.

pub mod body_box;
mod builder;
pub mod camera;
pub mod check;
mod cropped;
mod files;
mod folder;
mod held_out;
mod image;
mod mask_box;
mod shard;
pub mod skeleton;
mod view;
mod view_error;

pub use builder::ShardBuilder;
pub use cropped::{CroppedFrames, Rect};
pub use folder::{CaptureFolder, UploadFile};
pub use held_out::HeldOutView;
pub use image::FrameImage;
pub use mask_box::{MaskBox, mask_box};
pub use shard::Shard;
pub use view::CaptureView;
pub use view_error::ViewError;

use std::path::PathBuf;
use yoto_proto::pose_track::describe;
use yoto_proto::v1::Violation;

/// Why a capture or a shard can't be used.
#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    /// Faults in the user's data, each with its place. Never empty.
    #[error("{}", lines(.0))]
    Invalid(Vec<Violation>),
    /// A file that can't be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// Bytes that are not a training shard, or frames that do not fit a shard's track.
    #[error("training shard: {0}")]
    Shard(String),
}

impl CaptureError {
    /// What to tell the user to mend; empty when the data is not at fault.
    pub fn violations(&self) -> &[Violation] {
        match self {
            Self::Invalid(violations) => violations,
            Self::Io { .. } | Self::Shard(_) => &[],
        }
    }
}

fn lines(violations: &[Violation]) -> String {
    violations
        .iter()
        .map(describe)
        .collect::<Vec<_>>()
        .join("; ")
}

#[cfg(test)]
mod tests {
    use crate::camera::Camera;
    use crate::skeleton::Pose;
    use yoto_proto::pose_track::{PoseTrack, Skeleton};

    /// A valid track of `frames` frames of a single joint.
    pub(super) fn track(frames: u32, image_size: [u32; 2]) -> PoseTrack {
        let [width, height] = image_size;
        let camera = Camera::look_at(
            [0.0, 0.0, 3.0],
            [0.0; 3],
            [0.0, 1.0, 0.0],
            4.0,
            width,
            height,
        );
        PoseTrack {
            skeleton: Skeleton {
                names: vec!["root".into()],
                parents: vec![-1],
                rest_joints: vec![[0.0; 3]],
            },
            image_size,
            fps: 15.0,
            distortion: [0.0; 5],
            frames: (0..frames)
                .map(|index| camera.to_frame(index, &Pose::rest(1)))
                .collect(),
        }
    }
}
