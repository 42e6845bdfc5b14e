//! `yoto capture`: captures on this disk, without a service.

use super::correction::CorrectionArgs;
use super::ffmpeg_arg::FfmpegArg;
use super::media_args::MediaArgs;
use crate::capture_check;
use anyhow::Context;
use clap::{Args, Subcommand};
use image::ImageFormat;
use std::path::PathBuf;

const CHECK_HELP: &str = "\
Projects the skeleton onto the frames, measures how well bodies, masks and images agree, and
tries the common mistakes (inverted extrinsics, other units, exchanged left and right, K of
another resolution, masks of other frames, other axes). Writes report.json and sheet.png; the
exit status is 1 if any measure fails.

Examples:
  yoto capture check captures/ada
  yoto capture check captures/ada --out check/ada
  yoto capture check captures/ada --frames video
  yoto capture check captures/ada --extrinsics c2w --units camera=mm";

/// Check captures before an upload.
#[derive(Debug, Args)]
pub(super) struct CaptureCommand {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Check that poses, cameras, masks and images belong together.
    #[command(after_help = CHECK_HELP)]
    Check(Check),
}

#[derive(Debug, Args)]
struct Check {
    /// The capture: a folder or an archive.
    capture: PathBuf,
    /// Folder for report.json and sheet.png.
    #[arg(long, value_name = "DIR", default_value = "check")]
    out: PathBuf,
    #[command(flatten)]
    ffmpeg: FfmpegArg,
    #[command(flatten)]
    media: MediaArgs,
    #[command(flatten)]
    correction: CorrectionArgs,
}

impl CaptureCommand {
    pub(super) fn run(self) -> anyhow::Result<()> {
        let Action::Check(check) = self.action;
        let options = check.media.options(check.correction.correction());
        let checked = capture_check::check(&check.capture, &options, check.ffmpeg.program())?;
        let json = serde_json::to_vec_pretty(&checked.report).context("writing the report")?;
        let write = |name: &str, bytes: &[u8]| {
            let path = check.out.join(name);
            std::fs::create_dir_all(&check.out)
                .and_then(|()| std::fs::write(&path, bytes))
                .with_context(|| format!("writing {}", path.display()))
        };
        write("report.json", &json)?;
        let sheet = check.out.join("sheet.png");
        checked
            .sheet()?
            .save_with_format(&sheet, ImageFormat::Png)
            .with_context(|| format!("writing {}", sheet.display()))?;
        print!("{}", checked.text());
        println!("report: {}", check.out.join("report.json").display());
        println!("sheet: {}", sheet.display());
        let failed = checked.failed();
        anyhow::ensure!(failed == 0, "{failed} of the capture's measures failed");
        Ok(())
    }
}
