//! The measurements of training time and render time, as files and as text.

use super::{Curve, Machine, rows};
use crate::evaluate::SplitScores;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// `tradeoff.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Tradeoff {
    /// Version of this form.
    pub version: u32,
    /// Time of the measurement, seconds since 1970.
    pub unix_seconds: u64,
    /// The machine.
    pub machine: Machine,
    /// Names of the people.
    pub people: Vec<String>,
    /// Longest side of the pictures, pixels.
    pub size: u32,
    /// Trainings; empty if an existing model was measured.
    pub training: Vec<Trained>,
    /// Rendering, one curve per model: of each tier the longest-trained model.
    pub rendering: Vec<Curve>,
}

/// Results of one tier with one budget.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Trained {
    /// Quality tier.
    pub tier: String,
    /// Budget in seconds.
    pub budget_seconds: f64,
    /// Seconds of training, without evaluation.
    pub train_seconds: f64,
    /// Steps taken.
    pub steps: u64,
    /// Number of parameters.
    pub parameters: u64,
    /// Size of a checkpoint with optimiser state, bytes.
    pub checkpoint_bytes: u64,
    /// Peak resident memory of this process during the training, including captures, bytes;
    /// absent if the system does not report it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub peak_memory_bytes: Option<u64>,
    /// The objective.
    pub objective: String,
    /// Figures on held-out pictures.
    pub scores: SplitScores,
}

/// A file of a trade-off can't be written.
#[derive(Debug, Error)]
#[error("writing {path}")]
pub struct WriteError {
    /// The file or folder.
    path: PathBuf,
    /// The error of the system.
    source: std::io::Error,
}

impl Tradeoff {
    /// Version of `tradeoff.json` written by this program.
    pub const VERSION: u32 = 1;

    /// The results for an existing model: rendering only.
    pub fn of_model(name: &str, curve: Curve) -> Self {
        Self {
            version: Self::VERSION,
            unix_seconds: curve.unix_seconds,
            machine: curve.machine.clone(),
            people: vec![name.to_owned()],
            size: curve.size,
            training: Vec::new(),
            rendering: vec![curve],
        }
    }

    /// Writes `tradeoff.json` and `tradeoff.csv` into `folder`; the files' paths.
    ///
    /// # Errors
    /// When a file can't be written.
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, WriteError> {
        let failed = |path: &Path, source| WriteError {
            path: path.to_owned(),
            source,
        };
        std::fs::create_dir_all(folder).map_err(|error| failed(folder, error))?;
        let write = |name: &str, bytes: Vec<u8>| {
            let path = folder.join(name);
            std::fs::write(&path, bytes).map_err(|error| failed(&path, error))?;
            Ok(path)
        };
        let json = serde_json::to_vec_pretty(self).map_err(|error| failed(folder, error.into()))?;
        Ok(vec![
            write("tradeoff.json", json)?,
            write("tradeoff.csv", rows::csv(self).into_bytes())?,
        ])
    }

    /// The fronts of all curves and the accuracy of predictions for other sizes, as text.
    pub fn summary(&self) -> String {
        rows::summary(self)
    }
}
