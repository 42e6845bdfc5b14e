//! The program for videos that yoto does not decode itself.

use clap::Args;
use clap::builder::OsStringValueParser;
use std::ffi::OsString;
use std::path::Path;

#[derive(Debug, Clone, Args)]
pub(super) struct FfmpegArg {
    /// The ffmpeg for videos other than H.264 in MP4 or MOV [default: the one in PATH].
    #[arg(
        long,
        env = "YOTO_FFMPEG",
        value_name = "FILE",
        value_parser = OsStringValueParser::new(),
        hide_short_help = true
    )]
    ffmpeg: Option<OsString>,
}

impl FfmpegArg {
    /// The program, where it has a name.
    pub(super) fn program(&self) -> Option<&Path> {
        self.ffmpeg.as_deref().map(Path::new)
    }
}
