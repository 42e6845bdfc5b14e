//! The clip as a capture folder, and its check before anything is trained.

use super::AvatarOptions;
use crate::import_progress;
use anyhow::{Context, ensure};
use image::ImageFormat;
use std::path::Path;
use std::time::Instant;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::check::{CheckReport, Grade};
use yoto_capture::skeleton::Skeleton;
use yoto_import::capture_dir::CaptureOptions;
use yoto_import::{Findings, TrackForm, capture_check, to_folder};
use yoto_proto::pose_track::{Frame, PoseTrack};
use yoto_proto::smpl;
use yoto_terminal::output;

/// An imported clip.
pub(super) struct Captured {
    pub notes: Vec<String>,
    pub found: Findings,
    /// All frames of the source; some may not be used.
    pub available: usize,
    /// Numbers of the frames with the person.
    pub frames: Vec<u32>,
    pub image_size: [u32; 2],
    pub fps: f64,
    /// Median length of the person in the pictures, as a share of a picture's longer side, 0 to 1.
    pub person: f64,
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
        person: person(track),
        has_smpl_joints: has_smpl_joints(track),
        available: imported.available,
        found: imported.found,
        notes: imported.notes,
        seconds: started.elapsed().as_secs_f64(),
    })
}

/// Length of a body over the extent of its joints: the crown is above the head's joint, the soles are below the feet's.
const BEYOND_JOINTS: f64 = 1.15;
/// Least share of the person that is believed: a smaller one comes from wrong poses.
const SMALLEST: f64 = 0.1;

/// Median length of the person in the pictures, as a share of a picture's longer side, from the projected joints; 1 if no
/// frame tells.
fn person(track: &PoseTrack) -> f64 {
    let Ok(skeleton) = Skeleton::from_track(&track.skeleton) else {
        return 1.0;
    };
    let longer = f64::from(track.image_size[0].max(track.image_size[1]));
    let extent = |frame: &Frame| -> Option<f64> {
        let pose = Pose::from_frame(frame).ok()?;
        let camera = Camera::from_frame(frame, track.image_size).ok()?;
        let joints = skeleton.posed_joints(&pose);
        let shown: Vec<[f64; 2]> = joints.iter().filter_map(|it| camera.project(*it)).collect();
        let along = |axis: usize| {
            let most = shown.iter().map(|it| it[axis]).fold(f64::MIN, f64::max);
            let least = shown.iter().map(|it| it[axis]).fold(f64::MAX, f64::min);
            most - least
        };
        Some(along(0).max(along(1)))
    };
    let mut extents: Vec<f64> = track.frames.iter().filter_map(extent).collect();
    extents.sort_unstable_by(f64::total_cmp);
    let share = extents
        .get(extents.len() / 2)
        .map_or(1.0, |extent| BEYOND_JOINTS * extent / longer);
    match share.is_finite() {
        true => share.clamp(SMALLEST, 1.0),
        false => 1.0,
    }
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
    pub report: CheckReport,
    pub seconds: f64,
}

/// Checks the capture in `folder` and writes report and sheet to `out`; the program
/// `ffmpeg` decodes videos of other kinds, and is searched for when no path is given.
///
/// # Errors
/// When a measure fails, and the training is not wanted all the same (`despite`).
pub(super) fn check(
    folder: &Path,
    out: &Path,
    ffmpeg: Option<&Path>,
    despite: bool,
) -> anyhow::Result<Checked> {
    let started = Instant::now();
    let checked = capture_check::check(
        folder,
        &CaptureOptions::default(),
        ffmpeg,
        &import_progress::on_terminal(),
    )?;
    std::fs::create_dir_all(out).with_context(|| format!("making {}", out.display()))?;
    let report = out.join("report.json");
    let json = serde_json::to_vec_pretty(&checked.report).context("writing the report")?;
    std::fs::write(&report, json).with_context(|| format!("writing {}", report.display()))?;
    let sheet = out.join("sheet.png");
    checked
        .sheet()?
        .save_with_format(&sheet, ImageFormat::Png)
        .with_context(|| format!("writing {}", sheet.display()))?;
    detail!("{}", checked.text().trim_end());
    let failed: Vec<&str> = checked
        .report
        .measures
        .iter()
        .filter(|it| it.grade == Grade::Fail)
        .map(|it| it.kind.title())
        .collect();
    if !failed.is_empty() && output::style().brief {
        tell!("{}", checked.faults().trim_end());
    }
    ensure!(
        failed.is_empty() || despite,
        "the check of the capture failed: {} (see {}, and report.json beside it for the frames): mend the capture, or \
         train anyway (--despite-check)",
        failed.join(", "),
        sheet.display()
    );
    Ok(Checked {
        report: checked.report,
        seconds: started.elapsed().as_secs_f64(),
    })
}

#[cfg(test)]
mod tests {
    use super::person;
    use yoto_synthetic::SyntheticPerson;

    #[test]
    fn a_person_far_away_takes_less_of_the_picture() {
        let (mut track, _) = SyntheticPerson::cast(1, 7)[0].capture(8, 64);
        let near = person(&track);
        assert!((0.5..1.0).contains(&near), "{near}");
        for frame in &mut track.frames {
            let k = &mut frame.k;
            for row in k.iter_mut().take(2) {
                row[0] *= 0.5;
                row[1] *= 0.5;
            }
        }
        let far = person(&track);
        assert!((far / near - 0.5).abs() < 0.05, "{far} {near}");
        track.frames.clear();
        assert_eq!(person(&track), 1.0);
    }
}
