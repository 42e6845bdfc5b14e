//! Checking a capture folder before it is uploaded, and showing what was found.

mod canvas;
mod sheet;
mod text;
mod tiles;

use crate::api::{FileSource, UploadFile};
use crate::capture_dir::CaptureDir;
use anyhow::Context;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use yoto_avatar::capture::FrameImage;
use yoto_avatar::capture::check::{Checker, Grade, Report};
use yoto_proto::correction::Correction;
use yoto_proto::pose_track::PoseTrack;

/// A checked capture.
pub struct Checked {
    /// What was found.
    pub report: Report,
    name: String,
    asked: Correction,
    track: PoseTrack,
    files: HashMap<String, PathBuf>,
}

/// Checks the capture folder `dir`, its numbers read as `correction` says.
///
/// # Errors
/// A capture that can't be read; each fault names file, frame and field.
pub fn check(dir: &Path, correction: &Correction) -> anyhow::Result<Checked> {
    let capture = CaptureDir::open_corrected(dir, correction)?;
    let on_disk = |file: UploadFile| match file.source {
        FileSource::Disk(path) => Some((file.path, path)),
        FileSource::Memory(_) => None,
    };
    let mut checker = Checker::new(capture.track.clone())?;
    let name = dir.file_name().unwrap_or(dir.as_os_str());
    let mut checked = Checked {
        name: name.to_string_lossy().into_owned(),
        asked: *correction,
        files: capture.files.into_iter().filter_map(on_disk).collect(),
        report: Checker::new(capture.track.clone())?.finish(),
        track: capture.track,
    };
    for position in checker.wanted().to_vec() {
        checker.look(position, &checked.frame(position)?);
    }
    checked.report = checker.finish();
    Ok(checked)
}

impl Checked {
    /// Measures that failed.
    pub fn failed(&self) -> usize {
        let fails = |grade: Grade| grade == Grade::Fail;
        let measures = self.report.measures.iter();
        measures.filter(|it| fails(it.grade)).count()
    }

    /// The frame at `position`.
    fn frame(&self, position: usize) -> anyhow::Result<FrameImage> {
        let index = self.track.frames.get(position).map_or(0, |it| it.index);
        let names = ["frames", "masks"].map(|kind| format!("{kind}/{index:06}.png"));
        let read = |name: &String| -> anyhow::Result<Vec<u8>> {
            let path = self.files.get(name).with_context(|| format!("no {name}"))?;
            std::fs::read(path).with_context(|| format!("reading {}", path.display()))
        };
        let (image, mask) = (read(&names[0])?, read(&names[1])?);
        let size = self.track.image_size;
        Ok(FrameImage::decode(
            &image,
            &mask,
            size,
            index,
            (&names[0], &names[1]),
        )?)
    }

    /// What was found, for a terminal.
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
            let (grade, title) = (it.grade.name(), it.kind.title());
            text += &format!(
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
        }
        if !report.causes.is_empty() && !self.asked.is_identity() {
            text += &format!("what follows comes on top of `{}`\n", self.asked);
        }
        for cause in &report.causes {
            text += &format!("likeliest cause: {}\n", cause.sentence());
        }
        text
    }
}
