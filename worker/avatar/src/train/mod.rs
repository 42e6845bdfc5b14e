//! Training: patches in, steps taken, watched and kept.

pub mod batch;
mod checkpoint;
mod frame_order;
mod guard;
mod optimiser;
mod options;
mod parts;
mod patches;
mod people;
mod progress;
mod report;
mod start;
#[cfg(test)]
mod tests;
mod trainer;
mod validate;

pub use checkpoint::ModelState;
pub(crate) use checkpoint::save_model;
pub use optimiser::optimiser;
pub use options::{Budget, TrainOptions};
pub use parts::read_parts;
pub use people::{Person, is_held_out};
pub use progress::TrainProgress;
pub use trainer::Trainer;

use crate::config::ConfigError;
use crate::loss::lpips::LpipsError;
use crate::render::RenderError;
use thiserror::Error;
use yoto_capture::CaptureError;
use yoto_capture::skeleton::SkeletonError;

/// Why training can't start, go on, or be kept.
#[derive(Debug, Error)]
pub enum TrainError {
    /// The configuration can't be.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A person's skeleton or pose can't be used.
    #[error("{name}: {source}")]
    Skeleton {
        /// Whose.
        name: String,
        /// What is wrong.
        source: SkeletonError,
    },
    /// A person's shard can't be used.
    #[error("{name}: {source}")]
    Capture {
        /// Whose.
        name: String,
        /// What is wrong.
        source: CaptureError,
    },
    /// The people don't fit one model.
    #[error("{0}")]
    People(String),
    /// The objective's weights can't be used.
    #[error("LPIPS: {0}")]
    Lpips(#[from] LpipsError),
    /// A frame can't be rendered for validation.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A checkpoint's file can't be written or read.
    #[error("{file}: {message}")]
    File {
        /// Path.
        file: String,
        /// What is wrong.
        message: String,
    },
    /// A step came to no loss.
    #[error("the objective gave no number")]
    NoLoss,
    /// Step after step was not finite, and going back did not help.
    #[error(
        "training diverged at step {step}: {rollbacks} returns to an earlier state did not help"
    )]
    Diverged {
        /// Where.
        step: u64,
        /// Tries.
        rollbacks: u64,
    },
}
