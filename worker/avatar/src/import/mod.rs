//! Models of other programs as models of ours.

pub mod humannerf;
mod joints;
mod options;
mod tensors;

pub use humannerf::{Imported, import_humannerf};
pub use joints::read_canonical_joints;
pub use options::HumanNerfOptions;

use crate::train::TrainError;
use thiserror::Error;

/// Why a foreign model can't be read.
#[derive(Debug, Error)]
pub enum ImportError {
    /// A file can't be read as what it should be.
    #[error("{file}: {message}")]
    File {
        /// Path.
        file: String,
        /// What is wrong.
        message: String,
    },
    /// A file of PyTorch without HumanNeRF's networks.
    #[error("{file} holds no network: {message}")]
    NoNetwork {
        /// Path.
        file: String,
        /// What it holds instead.
        message: String,
    },
    /// Tensors are missing, or have another shape or type than expected; each entry names one. Never
    /// empty.
    #[error("{file}: {} of its tensors do not fit: {}", .faults.len(), .faults.join("; "))]
    Tensors {
        /// Path.
        file: String,
        /// One line per tensor.
        faults: Vec<String>,
    },
    /// The model can't be made or written.
    #[error(transparent)]
    Model(#[from] TrainError),
}

impl ImportError {
    fn file(path: &std::path::Path, message: impl std::fmt::Display) -> Self {
        Self::File {
            file: path.display().to_string(),
            message: message.to_string(),
        }
    }
}
