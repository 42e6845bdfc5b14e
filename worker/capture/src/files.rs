//! Reading a capture's files, with errors that name file and frame.

use super::{CaptureError, FrameImage};
use std::path::Path;
use yoto_proto::pose_track::{self, violation};
use yoto_proto::v1::Violation;

/// Largest file that is read, bytes. A pose track of 100,000 frames takes a quarter of it.
const MAX_BYTES: u64 = 1 << 30;

/// The error for a fault in the pose track.
pub(super) fn at_fault(field: impl Into<String>, message: impl Into<String>) -> CaptureError {
    let fault = violation("INVALID", pose_track::FILE, None, field, message);
    CaptureError::Invalid(vec![fault])
}

/// The violation for a missing file.
pub(super) fn missing(name: &str, frame: Option<u32>) -> Violation {
    violation("MISSING", name, frame, "", "there is no such file")
}

/// Decodes a frame and its mask; `names` are their paths inside the capture.
pub(super) fn read_frame(
    paths: (&Path, &Path),
    names: (&str, &str),
    size: [u32; 2],
    frame: u32,
) -> Result<FrameImage, CaptureError> {
    let image = read_file(paths.0, names.0, Some(frame))?;
    let mask = read_file(paths.1, names.1, Some(frame))?;
    FrameImage::decode(&image, &mask, size, frame, names)
}

/// The bytes of a file; `name` is its path inside the capture.
pub(super) fn read_file(
    path: &Path,
    name: &str,
    frame: Option<u32>,
) -> Result<Vec<u8>, CaptureError> {
    let failed = |source: std::io::Error| match source.kind() {
        std::io::ErrorKind::NotFound => CaptureError::Invalid(vec![missing(name, frame)]),
        _ => CaptureError::Io {
            path: path.to_path_buf(),
            source,
        },
    };
    let size = std::fs::metadata(path).map_err(failed)?.len();
    if size > MAX_BYTES {
        let message = format!("{size} bytes are more than the {MAX_BYTES} that are read");
        let fault = violation("TOO_LARGE", name, frame, "", message);
        return Err(CaptureError::Invalid(vec![fault]));
    }
    std::fs::read(path).map_err(failed)
}
