//! The clip as a capture folder, and its check before anything is trained.

use super::AvatarOptions;
use crate::capture_check;
use crate::capture_dir::CaptureOptions;
use crate::import::{TrackForm, to_folder};
use crate::progress::count;
use anyhow::{Context, ensure};
use image::ImageFormat;
use std::path::Path;
use std::time::Instant;
use yoto_capture::check::Report;

/// An imported clip.
pub(super) struct Captured {
    pub notes: Vec<String>,
    /// Numbers of the frames with the person.
    pub frames: Vec<u32>,
    pub image_size: [u32; 2],
    pub fps: f64,
    pub seconds: f64,
}

/// Writes the clip as a capture to `folder`.
pub(super) fn import(options: &AvatarOptions, folder: &Path) -> anyhow::Result<Captured> {
    let started = Instant::now();
    let imported = to_folder(
        options.format,
        &options.source,
        folder,
        TrackForm::Json,
        &options.import,
    )?;
    let track = &imported.track;
    Ok(Captured {
        frames: track.frames.iter().map(|frame| frame.index).collect(),
        image_size: track.image_size,
        fps: track.fps,
        notes: imported.notes,
        seconds: started.elapsed().as_secs_f64(),
    })
}

/// A check with the time that it took.
pub(super) struct Checked {
    pub report: Report,
    pub seconds: f64,
}

/// Checks the capture in `folder` and writes report and sheet to `out`; videos of other kinds are
/// decoded by the program `ffmpeg`, which is searched for when it has no name.
///
/// # Errors
/// When a measure fails, unless `despite` that the training is wanted.
pub(super) fn check(
    folder: &Path,
    out: &Path,
    ffmpeg: Option<&Path>,
    despite: bool,
) -> anyhow::Result<Checked> {
    let started = Instant::now();
    let checked = capture_check::check(folder, &CaptureOptions::default(), ffmpeg)?;
    std::fs::create_dir_all(out).with_context(|| format!("making {}", out.display()))?;
    let report = out.join("report.json");
    let json = serde_json::to_vec_pretty(&checked.report).context("writing the report")?;
    std::fs::write(&report, json).with_context(|| format!("writing {}", report.display()))?;
    let sheet = out.join("sheet.png");
    checked
        .sheet()?
        .save_with_format(&sheet, ImageFormat::Png)
        .with_context(|| format!("writing {}", sheet.display()))?;
    tell!("{}", checked.text().trim_end());
    tell!("sheet: {}", sheet.display());
    let failed = checked.failed();
    ensure!(
        failed == 0 || despite,
        "{} of the capture failed: mend what is named above, or train all the same \
         (--despite-check)",
        count(failed, "measure")
    );
    Ok(Checked {
        report: checked.report,
        seconds: started.elapsed().as_secs_f64(),
    })
}
