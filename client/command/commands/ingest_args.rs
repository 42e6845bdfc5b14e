//! Limits of the process that reads uploads.

use super::ffmpeg_arg::FfmpegArg;
use clap::Args;
use yoto_ingest::IngestSettings;

/// Limits for reading one upload.
#[derive(Debug, Clone, Args)]
pub(super) struct IngestArgs {
    /// Memory for reading one upload, MiB.
    #[arg(
        long,
        env = "YOTO_INGEST_MEMORY_MIB",
        value_name = "MIB",
        default_value_t = 4096
    )]
    ingest_memory_mib: u64,
    /// Time for reading one upload, seconds.
    #[arg(
        long,
        env = "YOTO_INGEST_SECONDS",
        value_name = "SECONDS",
        default_value_t = 3600
    )]
    ingest_seconds: u64,
    #[command(flatten)]
    ffmpeg: FfmpegArg,
}

impl IngestArgs {
    /// The same for a worker.
    pub(super) fn settings(&self) -> IngestSettings {
        IngestSettings {
            memory_bytes: self.ingest_memory_mib.saturating_mul(1 << 20),
            seconds: self.ingest_seconds,
            ffmpeg: self.ffmpeg.program().map(Into::into),
            ..IngestSettings::default()
        }
    }
}
