//! Training: patches in, steps taken, watched and kept.

mod checkpoint;
mod guard;
mod optimiser;
mod patches;
mod people;
mod progress;
mod trainer;

pub use checkpoint::State;
pub use people::Person;
pub use progress::TrainProgress;
pub use trainer::{Budget, TrainOptions, Trainer};

use crate::capture::CaptureError;
use crate::config::ConfigError;
use crate::render::RenderError;
use crate::skeleton::SkeletonError;
use thiserror::Error;

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
