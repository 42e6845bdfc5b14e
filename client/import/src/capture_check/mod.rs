//! Checks a capture before the upload, and shows the findings.
//!
//! Files are found as for an upload and read as in an ingest job, including videos and archives,
//! so that both give the same report.

mod canvas;
mod refined;
mod sheet;
mod text;
mod tiles;

pub use refined::refined_sheet;

pub(crate) use canvas::line;
pub(crate) use text::{LETTER, write};

use crate::capture_dir::{CaptureOptions, DecodedCapture};
use crate::{Progress, Stage};
use std::collections::HashMap;
use std::path::Path;
use yoto_capture::FrameImage;
use yoto_capture::check::{CheckReport, Checker, Grade, Measure};
use yoto_ingest::LocalCapture;
use yoto_proto::correction::Correction;
use yoto_proto::pose_track::PoseTrack;

/// A checked capture.
pub struct Checked {
    /// The findings.
    pub report: CheckReport,
    name: String,
    asked: Correction,
    capture: LocalCapture,
}

/// Checks the capture at `path`, a folder or an archive, read as `options` say; videos of other
/// kinds by the program `ffmpeg`, which is searched for when it has no name. `progress` receives the frames of [`Stage::Check`].
///
/// # Errors
/// A capture that can't be read; each fault names file, frame and field.
pub fn check(
    path: &Path,
    options: &CaptureOptions,
    ffmpeg: Option<&Path>,
    progress: &Progress,
) -> anyhow::Result<Checked> {
    let DecodedCapture {
        name,
        plan,
        capture,
    } = DecodedCapture::open(path, options, ffmpeg)?;
    let mut checker = Checker::new(capture.track().clone())?;
    let wanted = checker.wanted().to_vec();
    let running = progress.start(Stage::Check);
    let mut done = 0;
    capture.frames(&wanted, |position, frame| {
        checker.look(position, &frame);
        done += 1;
        running.count(done, wanted.len());
    })?;
    drop(running);
    Ok(Checked {
        report: checker.finish(),
        asked: plan.correction,
        capture,
        name,
    })
}

impl Checked {
    /// Measures that failed.
    pub fn failed(&self) -> usize {
        let fails = |grade: Grade| grade == Grade::Fail;
        let measures = self.report.measures.iter();
        measures.filter(|it| fails(it.grade)).count()
    }

    /// The selected frames, as read by the check.
    fn track(&self) -> &PoseTrack {
        self.capture.track()
    }

    /// The frames at `positions`.
    fn frames(&self, positions: &[usize]) -> anyhow::Result<HashMap<usize, FrameImage>> {
        let mut rising = positions.to_vec();
        rising.sort_unstable();
        rising.dedup();
        let mut frames = HashMap::new();
        self.capture.frames(&rising, |position, frame| {
            frames.insert(position, frame);
        })?;
        Ok(frames)
    }

    /// The findings, as text for a terminal.
    pub fn text(&self) -> String {
        let report = &self.report;
        let mut text = format!(
            "{}: {}, {} of {} frames looked at\n",
            self.name,
            report.grade.name(),
            report.looked_at,
            report.frames
        );
        for it in &report.measures {
            text += &lines(it);
        }
        for note in self.capture.notes() {
            text += &format!("note: {note}\n");
        }
        text += &self.causes();
        for advice in &report.advice {
            text += &format!("advice: {advice}\n");
        }
        text
    }

    /// The measures that failed and the likeliest causes, as text for a terminal; empty if none failed.
    pub fn faults(&self) -> String {
        let failed = |it: &&Measure| it.grade == Grade::Fail;
        let text: String = self
            .report
            .measures
            .iter()
            .filter(failed)
            .map(lines)
            .collect();
        match text.is_empty() {
            true => text,
            false => text + &self.causes(),
        }
    }

    fn causes(&self) -> String {
        let mut text = String::new();
        if !self.report.causes.is_empty() && !self.asked.is_identity() {
            text += &format!("the following is in addition to `{}`\n", self.asked);
        }
        for cause in &self.report.causes {
            text += &format!("most likely cause: {}\n", cause.sentence());
        }
        text
    }
}

/// A measure with its cause and frames, on lines of their own.
fn lines(it: &Measure) -> String {
    let (grade, title) = (it.grade.name(), it.kind.title());
    let mut text = format!(
        "  {grade:<4}  {title:<22}  {:<16}  {}\n",
        it.shown, it.meaning
    );
    if let Some(cause) = &it.cause {
        text += &format!("        {cause}\n");
    }
    if !it.frames.is_empty() && it.grade != Grade::Pass {
        let frames: Vec<String> = it.frames.iter().map(u32::to_string).collect();
        text += &format!("        see frames {}\n", frames.join(", "));
    }
    text
}
