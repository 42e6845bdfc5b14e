//! Training: batches of patches, steps, their supervision, and checkpoints.

mod data;
mod exposure;
mod frames;
mod known;
mod model;
mod people;
mod poses;
mod report;
mod run;
mod splats;
mod start;
#[cfg(test)]
mod tests;
mod trainer;

pub use exposure::{CaptureExposures, capture_exposures};
pub use frames::batch;
pub use people::learn::Learn;
pub use people::{TrainPerson, leaving};
pub use poses::refinement_file::refined_track;
pub use run::checkpoint::ModelState;
#[cfg(test)]
pub(crate) use run::checkpoint::load_avatar;
pub(crate) use run::checkpoint::save_model;
pub use run::optimiser::optimiser;
pub use run::options::{Budget, TrainOptions, Validation};
pub use run::parts::read_parts;
pub use run::progress::TrainProgress;
pub use run::validate::Preview;
pub use trainer::Trainer;

use crate::config::ConfigError;
use crate::host::ReadError;
use crate::loss::lpips::LpipsError;
use crate::render::RenderError;
use thiserror::Error;
use yoto_capture::CaptureError;
use yoto_capture::skeleton::SkeletonError;

/// Training error.
#[derive(Debug, Error)]
pub enum TrainError {
    /// The configuration is invalid.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A person's skeleton or pose is invalid.
    #[error("{name}: {source}")]
    Skeleton {
        /// Name of the person.
        name: String,
        /// What is wrong.
        source: SkeletonError,
    },
    /// A person's shard is invalid.
    #[error("{name}: {source}")]
    Capture {
        /// Name of the person.
        name: String,
        /// What is wrong.
        source: CaptureError,
    },
    /// The people can't be trained in one model.
    #[error("{0}")]
    People(String),
    /// The weights of LPIPS can't be used.
    #[error("LPIPS: {0}")]
    Lpips(#[from] LpipsError),
    /// A batch or a validation frame can't be rendered.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A tensor can't be read from its device.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A file of a checkpoint can't be written or read.
    #[error("{file}: {message}")]
    File {
        /// Path.
        file: String,
        /// What is wrong.
        message: String,
    },
    /// An objective that compares patches, for a model that learns from whole pictures.
    #[error(
        "the tier {tier} can't learn by the objective {objective}: its splats learn from whole pictures by a \
         fixed loss, and an objective compares patches; use a tier with a field, such as fast"
    )]
    Objective {
        /// Name of the objective.
        objective: &'static str,
        /// Tier of the model.
        tier: String,
    },
    /// The objective has no value.
    #[error("the objective has no value")]
    NoLoss,
    /// Losses or gradients remained non-finite after all returns to an earlier state.
    #[error(
        "training diverged at step {step}: {rollbacks} returns to an earlier state did not help"
    )]
    Diverged {
        /// Last step.
        step: u64,
        /// Number of returns.
        rollbacks: u64,
    },
}
