//! Captures: people as cameras saw them, without any tensor library.
//!
//! A user has a [`folder`]. Ingest makes a [`shard`] of it, which training reads: the same frames,
//! decoded, checked and cropped to the person. [`skeleton`] and [`camera`] are the geometry that all
//! other crates share, [`body_box`] is the box around a posed body that rays are cut to, and [`check`]
//! measures a capture's quality.

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
#[cfg(test)]
mod test_support;
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
    /// Faults in the user's data, each with its file and field. Never empty.
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
    /// Bytes that are not a training shard, or frames that don't fit a shard's track.
    #[error("training shard: {0}")]
    Shard(String),
}

impl CaptureError {
    /// The faults that the user can correct; empty if the data is not at fault.
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
