//! Errors of pose models.

use std::path::PathBuf;

/// An error of a pose model or of its input picture.
#[derive(Debug, thiserror::Error)]
pub enum LandmarkError {
    /// A file of the model is absent.
    #[error("{}: there is no such file; deploy/models/get.sh fetches the pose model", .0.display())]
    Missing(PathBuf),
    /// A folder without a landmark model.
    #[error(
        "{}: holds none of pose_landmark_heavy.tflite, pose_landmark_full.tflite and \
         pose_landmark_lite.tflite; deploy/models/get.sh fetches the pose model",
        .0.display()
    )]
    Empty(PathBuf),
    /// A file of the model can't be read.
    #[error("reading {}: {error}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        error: std::io::Error,
    },
    /// A file is not a model that this program can run.
    #[error("{}: {message}", path.display())]
    Model {
        /// The file.
        path: PathBuf,
        /// The fault, in words.
        message: String,
    },
    /// The pixels do not make a picture of the given size.
    #[error("a picture of {width}x{height} has {bytes} bytes: {width} x {height} x 3 are needed")]
    Picture {
        /// Pixels per row.
        width: usize,
        /// Rows.
        height: usize,
        /// Bytes given.
        bytes: usize,
    },
}
