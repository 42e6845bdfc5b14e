//! From one model to another: splats that learn a person from a field's pictures.
//!
//! ```text
//! field, poses → teacher (pictures from all around) → student (a training on them) → a model of splats
//! ```

mod student;
mod teacher;

pub use student::{DistillStage, Distilled, FEWEST, StudentTraining};
pub use teacher::{CaptureFrame, Teacher};

use crate::config::ConfigError;
use crate::render::RenderError;
use crate::train::TrainError;
use yoto_capture::{CaptureError, ViewError};

/// Splats that can't be made.
#[derive(Debug, thiserror::Error)]
pub enum DistillError {
    /// The model has no such slot.
    #[error("the model has no slot {0}")]
    NoSuchSlot(usize),
    /// There are no poses.
    #[error("no poses to draw the person in")]
    NoPoses,
    /// A picture can't be rendered.
    #[error("picture {index}")]
    Render {
        /// Its index among the pictures.
        index: usize,
        /// What is wrong.
        source: RenderError,
    },
    /// The camera of a frame of the capture is invalid.
    #[error("frame {frame}")]
    View {
        /// Its number.
        frame: u32,
        /// What is wrong.
        source: ViewError,
    },
    /// The pictures do not make a valid capture.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// This version has no splats.
    #[error("the configuration of the splats")]
    Config(#[from] ConfigError),
    /// The splats can't learn.
    #[error("{doing}")]
    Train {
        /// The part of the training.
        doing: &'static str,
        /// What is wrong.
        source: TrainError,
    },
    /// The caller wanted it no longer.
    #[error("stopped")]
    Stopped,
}
