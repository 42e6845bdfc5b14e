//! Limits of a capture's size.

use serde::{Deserialize, Serialize};
use yoto_proto::pose_track::{MAX_FRAMES, MAX_SIDE};

/// Limits enforced before anything is decoded.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Limits {
    /// Longest side of a picture, pixels.
    pub side: u32,
    /// Frames of a video.
    pub frames: usize,
    /// Bytes of one file that is read into memory: a still, a pose track, a frame's packet.
    pub file_bytes: u64,
    /// Entries of one archive.
    pub entries: usize,
    /// Bytes that all archives of a capture may unpack to.
    pub unpacked_bytes: u64,
    /// Largest ratio of unpacked to packed size of an archive, beyond 64 MiB: pictures and
    /// videos are compressed already, so an archive that grows more is a bomb.
    pub unpacked_ratio: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            side: MAX_SIDE,
            frames: MAX_FRAMES,
            file_bytes: 256 << 20,
            entries: 2 * MAX_FRAMES + 16,
            unpacked_bytes: 16 << 30,
            unpacked_ratio: 100,
        }
    }
}
