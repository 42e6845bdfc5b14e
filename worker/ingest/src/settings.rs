//! Program and limits for reading uploads.

use std::path::PathBuf;
use yoto_media::Limits;

/// Limits of the child process that reads one upload.
#[derive(Debug, Clone)]
pub struct IngestSettings {
    /// The program to start; `None` means this program. It must call
    /// [`become_ingest_child_if_asked`](crate::become_ingest_child_if_asked) before anything else.
    pub program: Option<PathBuf>,
    /// Address space of the child, bytes.
    pub memory_bytes: u64,
    /// Time limit of the child, seconds, both elapsed and processor time.
    pub seconds: u64,
    /// Limits of a capture.
    pub limits: Limits,
    /// The `ffmpeg` for videos that are not read in-process; searched for if it has no name.
    pub ffmpeg: Option<PathBuf>,
    /// The pose model for films without poses, a file or a folder; without it, a film needs poses. The program must know how to
    /// use it ([`FilmReader`](crate::FilmReader)).
    pub pose_model: Option<PathBuf>,
    /// Whether a worker refuses to start where the kernel can't confine the child
    /// ([`Confinement::is_whole`](crate::Confinement::is_whole)).
    pub require_confinement: bool,
}

impl Default for IngestSettings {
    fn default() -> Self {
        Self {
            program: None,
            memory_bytes: 4 << 30,
            seconds: 3600,
            limits: Limits::default(),
            ffmpeg: None,
            pose_model: None,
            require_confinement: false,
        }
    }
}
