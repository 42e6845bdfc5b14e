//! `yoto capture`: captures on this disk, without a service.

mod example;
pub(crate) mod import;

use crate::args::correction::CorrectionArgs;
use crate::args::media::MediaArgs;
use crate::import_progress;
use anyhow::Context;
use clap::{Args, Subcommand};
use example::Example;
use image::ImageFormat;
use serde::Serialize;
use std::path::{Path, PathBuf};
use yoto_capture::check::CheckReport;
use yoto_import::{FfmpegArg, capture_check};
use yoto_terminal::output;

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

/// Check captures before an upload, or make some to try things with.
#[derive(Debug, Args)]
pub(crate) struct CaptureCommand {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Check that poses, cameras, masks and images belong together.
    #[command(after_help = CHECK_HELP)]
    Check(Check),
    /// Make captures of synthetic people, to try things with.
    #[command(after_help = example::AFTER_HELP)]
    Example(Example),
}

#[derive(Debug, Args)]
struct Check {
    /// The capture: a folder or an archive.
    capture: PathBuf,
    /// Folder for report.json and sheet.png [default: check/ and the capture's name].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Overwrite the report of another capture.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    ffmpeg: FfmpegArg,
    #[command(flatten)]
    media: MediaArgs,
    #[command(flatten)]
    correction: CorrectionArgs,
}

/// File with the findings.
const REPORT: &str = "report.json";

/// The content of [`REPORT`].
#[derive(Serialize)]
struct Written<'a> {
    /// Path of the capture.
    capture: String,
    #[serde(flatten)]
    report: &'a CheckReport,
}

impl Check {
    /// Folder for the files.
    fn out(&self) -> anyhow::Result<PathBuf> {
        if let Some(out) = &self.out {
            return Ok(out.clone());
        }
        let whole = PathBuf::from(path(&self.capture)?);
        let name = whole.file_stem().unwrap_or_default();
        Ok(Path::new("check").join(name))
    }
}

/// The absolute path of `capture`.
fn path(capture: &Path) -> anyhow::Result<String> {
    let path =
        std::fs::canonicalize(capture).with_context(|| format!("reading {}", capture.display()))?;
    Ok(path.display().to_string())
}

/// Checks that the `report` that is there already, if any, is of the same capture.
fn ensure_own(report: &Path, capture: &Path) -> anyhow::Result<()> {
    let bytes = match std::fs::read(report) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(error).with_context(|| format!("reading {}", report.display())),
    };
    let json: Option<serde_json::Value> = serde_json::from_slice(&bytes).ok();
    let of = json.as_ref().and_then(|json| json["capture"].as_str());
    let of = of.unwrap_or("something else");
    anyhow::ensure!(
        of == path(capture)?,
        "{} is there already, of {of}: choose another folder (--out), or overwrite it (--force)",
        report.display()
    );
    Ok(())
}

impl CaptureCommand {
    pub(crate) fn run(self) -> anyhow::Result<()> {
        match self.action {
            Action::Check(check) => check.run(),
            Action::Example(example) => example.run(),
        }
    }
}

impl Check {
    fn run(self) -> anyhow::Result<()> {
        let options = self.media.options(self.correction.correction());
        let out = self.out()?;
        let report = out.join(REPORT);
        if !self.force {
            ensure_own(&report, &self.capture)?;
        }
        let checked = capture_check::check(
            &self.capture,
            &options,
            self.ffmpeg.program(),
            &import_progress::on_terminal(),
        )?;
        let written = Written {
            capture: path(&self.capture)?,
            report: &checked.report,
        };
        let json = serde_json::to_vec_pretty(&written).context("writing the report")?;
        std::fs::create_dir_all(&out)
            .and_then(|()| std::fs::write(&report, json))
            .with_context(|| format!("writing {}", report.display()))?;
        let sheet = out.join("sheet.png");
        checked
            .sheet()?
            .save_with_format(&sheet, ImageFormat::Png)
            .with_context(|| format!("writing {}", sheet.display()))?;
        say!("{}", checked.text().trim_end());
        output::put("report", serde_json::to_value(&written)?);
        output::put("files", output::paths(&[&report, &sheet]));
        say!("report: {}", report.display());
        say!("sheet: {}", sheet.display());
        let failed = checked.failed();
        anyhow::ensure!(failed == 0, "{failed} of the capture's measures failed");
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_is_replaced_by_one_of_the_same_capture_only() {
        let dir = tempfile::tempdir().expect("a folder");
        let at = |name: &str| dir.path().join(name);
        for capture in ["ada", "bob"] {
            std::fs::create_dir(at(capture)).expect("a folder");
        }
        let report = at(REPORT);
        ensure_own(&report, &at("ada")).expect("none yet");
        let json = serde_json::json!({"capture": path(&at("ada")).expect("is there")});
        std::fs::write(&report, json.to_string()).expect("writes");
        ensure_own(&report, &at("ada")).expect("its own");
        let error = ensure_own(&report, &at("bob")).expect_err("of another");
        assert!(
            error.to_string().contains("is there already, of "),
            "{error}"
        );
        std::fs::write(&report, "{}").expect("writes");
        assert!(
            ensure_own(&report, &at("ada")).is_err(),
            "of something else"
        );
    }
}
