//! The demo's figures, as `report.json` and as a table.
//!
//! `yoto-lab quality` writes the same fields and more, so that one reader works for both.

use serde::Serialize;
use std::path::Path;
use yoto_avatar::evaluate::{SplitScores, SubjectScore, split_table};

/// `report.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct DemoReport {
    /// One entry per person.
    pub subjects: Vec<SubjectScore>,
    /// The subjects' figures, averaged.
    pub mean: SplitScores,
    /// Training steps taken.
    pub steps: u64,
    /// Seconds of training, without evaluation.
    pub train_seconds: f64,
    /// `steps / train_seconds`.
    pub steps_per_second: f64,
    /// Number of parameters.
    pub parameters: u64,
    /// Size of a checkpoint with optimiser state, bytes.
    pub checkpoint_bytes: u64,
    /// The device that trained.
    pub device: String,
    /// The objective, e.g. "lpips+mse", or the fallback without LPIPS weights.
    pub objective: String,
    /// Parts of the model that become active during a run, and were at its end.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub active_parts: Vec<String>,
    /// Notes on refined poses with the reason, and on single frames.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// Seconds to render a frame at the evaluated size.
    pub render_seconds_per_frame: f64,
    /// The settings of the run.
    pub settings: Settings,
}

/// The settings behind a report's figures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Settings {
    /// Quality tier.
    pub tier: String,
    /// Model variant.
    pub variant: String,
    /// Longest image side trained and evaluated at, pixels.
    pub size: u32,
    /// Random seed.
    pub seed: u64,
}

impl DemoReport {
    /// Writes `report.json`, and creates its folder.
    ///
    /// # Errors
    /// When the file can't be written.
    pub(crate) fn write(&self, path: &Path) -> std::io::Result<()> {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        let mut json = serde_json::to_string_pretty(self)?;
        json.push('\n');
        std::fs::write(path, json)
    }

    /// The figures as a readable table, with a line on steps, time and device.
    pub(crate) fn table(&self) -> String {
        let mut lines = split_table(&self.subjects, &self.mean);
        lines.push(format!(
            "{} steps in {:.0} s ({:.1} steps/s, objective {}) on {}; {:.2} M parameters, checkpoint {:.1} MB, {:.2} s per rendered frame",
            self.steps,
            self.train_seconds,
            self.steps_per_second,
            self.objective,
            self.device,
            self.parameters as f64 / 1e6,
            self.checkpoint_bytes as f64 / 1e6,
            self.render_seconds_per_frame
        ));
        if !self.active_parts.is_empty() {
            lines.push(format!(
                "active at the end: {}",
                self.active_parts.join(", ")
            ));
        }
        lines.extend(self.notes.iter().cloned());
        lines.join("\n")
    }
}
