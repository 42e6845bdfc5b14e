//! Training: batches of patches, steps, their supervision, and checkpoints.

pub mod batch;
mod checkpoint;
mod expected_errors;
mod exposure;
mod first_splats;
mod fit_poses;
mod frame_order;
mod guard;
mod hull;
mod learn;
pub mod leaving;
mod optimiser;
mod options;
mod parts;
mod patches;
mod people;
mod placing;
mod progress;
mod refinement;
mod refinement_file;
mod report;
mod start;
#[cfg(test)]
mod tests;
mod trainer;
mod trunk;
mod unseen;
mod validate;
mod whole_picture;
mod whose_poses;
mod wrong_frames;

pub use checkpoint::ModelState;
pub(crate) use checkpoint::save_model;
pub use exposure::{FilmExposures, film_exposures};
pub use learn::Learn;
pub use optimiser::optimiser;
pub use options::{Budget, TrainOptions, Validation};
pub use parts::read_parts;
pub use people::Person;
pub use progress::TrainProgress;
pub use refinement_file::refined_track;
pub use trainer::Trainer;
pub use validate::Preview;

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
