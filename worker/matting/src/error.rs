//! Errors of matting models.

use std::path::PathBuf;

/// An error of a matting model or of a picture given to it.
#[derive(Debug, thiserror::Error)]
pub enum MattingError {
    /// The file can't be read.
    #[error("reading {}: {error}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        error: std::io::Error,
    },
    /// The file is not ONNX, or has unknown operators.
    #[error("{}: {message}", path.display())]
    Load {
        /// The file.
        path: PathBuf,
        /// The fault, in words.
        message: String,
    },
    /// The inputs or outputs are not those of a matting model.
    #[error(
        "{}: {message}. A matting model takes one picture [1, 3, height, width] of 32-bit floats and \
         gives its matte, or is RVM's (src, r1i to r4i, downsample_ratio)",
        path.display()
    )]
    Form {
        /// The file.
        path: PathBuf,
        /// The fault, in words.
        message: String,
    },
    /// The network failed on a picture, or its output is not a matte.
    #[error("{}: {message}", path.display())]
    Run {
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
