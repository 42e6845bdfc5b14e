//! The option `--ffmpeg`: all commands that read videos have it, in `yoto` and in `yoto-lab`.

use clap::Args;
use clap::builder::OsStringValueParser;
use std::ffi::OsString;
use std::path::Path;
use yoto_media::video::FFMPEG_VARIABLE;

/// The program for videos that yoto does not decode itself.
#[derive(Debug, Clone, Args)]
pub struct FfmpegArg {
    /// The ffmpeg for videos other than H.264 in MP4 or MOV [default: the one in PATH].
    #[arg(
        long,
        env = FFMPEG_VARIABLE,
        value_name = "FILE",
        value_parser = OsStringValueParser::new(),
        hide_short_help = true
    )]
    ffmpeg: Option<OsString>,
}

impl FfmpegArg {
    /// Path of the program, if one was named.
    pub fn program(&self) -> Option<&Path> {
        self.ffmpeg.as_deref().map(Path::new)
    }
}
