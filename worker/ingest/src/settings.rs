//! By which program uploads are read, and within which limits.

use std::path::PathBuf;
use yoto_media::Limits;

/// Limits of the child process that reads one upload.
#[derive(Debug, Clone)]
pub struct IngestSettings {
    /// The program to start; none means this one again. Whatever it is must call
    /// [`become_ingest_child_if_asked`](crate::become_ingest_child_if_asked) before anything else.
    pub program: Option<PathBuf>,
    /// Address space of the child, bytes.
    pub memory_bytes: u64,
    /// How long the child may take, seconds, on the clock as well as on the processor.
    pub seconds: u64,
    /// What a capture may hold.
    pub limits: Limits,
    /// The `ffmpeg` for videos that are not read in-process; searched for when it has no name.
    pub ffmpeg: Option<PathBuf>,
}

impl Default for IngestSettings {
    fn default() -> Self {
        Self {
            program: None,
            memory_bytes: 4 << 30,
            seconds: 3600,
            limits: Limits::default(),
            ffmpeg: None,
        }
    }
}
