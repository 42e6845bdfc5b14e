//! The end of a video, from its headers.

use super::{mp4, sniffed};
use crate::{Limits, MediaError, sniff};
use std::path::Path;
use yoto_proto::media_plan::VideoEnd;

/// Where the MP4 or MOV at `path` ends, of any codec, without decoding it. `None` for other
/// containers, whose headers don't count their frames, and for what is no video.
///
/// # Errors
/// A file that can't be read, and headers at fault.
pub fn end(path: &Path, limits: &Limits) -> Result<Option<VideoEnd>, MediaError> {
    if !matches!(sniffed(path)?, sniff::Kind::Mp4) {
        return Ok(None);
    }
    let times = mp4::open(path, limits)?.times;
    Ok(times.last().map(|&seconds| VideoEnd {
        frames: times.len(),
        seconds,
    }))
}
