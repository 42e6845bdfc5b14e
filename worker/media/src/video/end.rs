//! The end of a video, from its headers.

use super::{mp4, sniffed};
use crate::{Limits, MediaError, sniff};
use std::path::Path;
use yoto_proto::media_plan::VideoEnd;

/// The end of the MP4 or MOV at `path`, with any codec, without decoding it. `None` for other
/// containers, as their headers don't count frames, and for files that are not videos.
///
/// # Errors
/// If the file can't be read, or its headers are invalid.
pub fn end(path: &Path, limits: &Limits) -> Result<Option<VideoEnd>, MediaError> {
    if !matches!(sniffed(path)?, sniff::FileType::Mp4) {
        return Ok(None);
    }
    let times = mp4::open(path, limits)?.times;
    Ok(times.last().map(|&seconds| VideoEnd {
        frames: times.len(),
        seconds,
    }))
}
