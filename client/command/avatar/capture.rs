//! The clip as a capture folder, and its check before anything is trained.

use super::AvatarOptions;
use anyhow::{Context, ensure};
use image::ImageFormat;
use std::path::Path;
use std::time::Instant;
use yoto_capture::check::Report;
use yoto_import::capture_check;
use yoto_import::capture_dir::CaptureOptions;
use yoto_import::{TrackForm, to_folder};
use yoto_proto::pose_track::PoseTrack;
use yoto_proto::smpl;
use yoto_terminal::progress::count;

/// An imported clip.
pub(super) struct Captured {
    pub notes: Vec<String>,
    /// Numbers of the frames with the person.
    pub frames: Vec<u32>,
    pub image_size: [u32; 2],
    pub fps: f64,
    /// Whether a motion of SMPL's joints moves the person.
    pub has_smpl_joints: bool,
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
        has_smpl_joints: has_smpl_joints(track),
        notes: imported.notes,
        seconds: started.elapsed().as_secs_f64(),
    })
}

/// Whether at least half of the joints are SMPL's, by the names that ingest gives them.
fn has_smpl_joints(track: &PoseTrack) -> bool {
    let mut bare = PoseTrack {
        skeleton: track.skeleton.clone(),
        image_size: track.image_size,
        fps: track.fps,
        distortion: track.distortion,
        frames: Vec::new(),
    };
    smpl::unify(&mut bare);
    let is_smpl_s = |name: &&String| smpl::JOINTS.iter().any(|(joint, _)| joint == name);
    let shared = bare.skeleton.names.iter().filter(is_smpl_s).count();
    2 * shared >= bare.skeleton.names.len().min(smpl::JOINTS.len())
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
    let failed = checked.failed();
    ensure!(
        failed == 0 || despite,
        "{} of the capture failed (see {}): mend what is named above, or train anyway \
         (--despite-check)",
        count(failed, "measure"),
        sheet.display()
    );
    Ok(Checked {
        report: checked.report,
        seconds: started.elapsed().as_secs_f64(),
    })
}
