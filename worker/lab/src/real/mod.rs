//! Clips as people have them, each through the whole path: poses and masks found, checked, trained, and measured
//! on frames that were held out.
//!
//! Rendered captures have exact poses and masks; a gain on them can be a loss here (docs/research/splats-films.md).

mod contact_sheet;
mod table;

use crate::captures::CaptureSource;
use crate::display::Screen;
use crate::one_camera::{HeldOut, OneCamera};
use crate::quality::{self, QualityOptions};
use crate::report::QualityReport;
use anyhow::{Context, ensure};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::time::Instant;
use yoto_capture::check::Grade;
use yoto_import::capture_dir::CaptureOptions;
use yoto_import::{Format, Options, TrackForm, capture_check, to_folder};
use yoto_proto::media_plan::{VIDEO_ENDINGS, has_ending};
use yoto_proto::pose_track::FILES;

pub use table::table;

/// One frame in this many is held out, and the middles of this many parts of a clip.
const HELD_OUT: HeldOut = HeldOut::EveryAndBlocks {
    every: 10,
    blocks: 3,
};

/// How to measure clips.
#[derive(Debug, Clone)]
pub struct RealOptions {
    /// A folder of clips and captures, or one of them.
    pub source: PathBuf,
    /// Folder for captures, reports and pictures.
    pub out: PathBuf,
    /// Settings by which the clips are read.
    pub import: Options,
    /// How a model is trained and measured; captures and held-out frames are those of the clips.
    pub quality: QualityOptions,
}

/// A clip, and what became of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Clip {
    /// Its name.
    pub name: String,
    /// Frames with the person.
    pub frames: usize,
    /// Measures of the check that are doubtful.
    pub doubts: Vec<String>,
    /// Time that each stage took.
    pub seconds: Seconds,
    /// What was measured; absent if the clip was stopped.
    pub report: Option<QualityReport>,
    /// Why it was stopped.
    pub stopped: Option<String>,
}

/// Seconds by stage.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Seconds {
    /// Search for the person; 0 for a capture.
    pub import: f64,
    /// Check of the capture.
    pub check: f64,
    /// Everything after it: decoding, training, measuring.
    pub quality: f64,
}

/// Takes each clip through the whole path. What stops one is in its entry.
///
/// # Errors
/// If the folder has no clips, or results can't be written.
pub fn run(options: &RealOptions, screen: &dyn Screen) -> anyhow::Result<Vec<Clip>> {
    let sources = sources(&options.source)?;
    let mut clips = Vec::new();
    for source in &sources {
        let name = name_of(source);
        screen.note(&format!("{name}: {}", source.display()));
        let folder = options.out.join(&name);
        let mut clip = Clip {
            name,
            frames: 0,
            doubts: Vec::new(),
            seconds: Seconds::default(),
            report: None,
            stopped: None,
        };
        match measured(options, source, &folder, &mut clip, screen) {
            Ok(report) => clip.report = Some(report),
            Err(error) => {
                let why = format!("{error:#}");
                screen.note(&format!("{}: stopped: {why}", clip.name));
                clip.stopped = Some(why);
            }
        }
        clips.push(clip);
        let path = options.out.join("report.json");
        let json = serde_json::to_vec_pretty(&clips).context("writing the report")?;
        std::fs::create_dir_all(&options.out)
            .with_context(|| format!("making {}", options.out.display()))?;
        std::fs::write(&path, json).with_context(|| format!("writing {}", path.display()))?;
    }
    contact_sheet::write(&options.out, &clips)?;
    Ok(clips)
}

/// The clips and captures of a folder, by name; a capture, or a single clip, alone.
fn sources(source: &Path) -> anyhow::Result<Vec<PathBuf>> {
    if is_source(source) {
        return Ok(vec![source.to_owned()]);
    }
    let reading = || format!("reading {}", source.display());
    let mut found = Vec::new();
    for entry in std::fs::read_dir(source).with_context(reading)? {
        let path = entry.with_context(reading)?.path();
        if is_source(&path) {
            found.push(path);
        }
    }
    found.sort();
    ensure!(
        !found.is_empty(),
        "{} has no clips ({}) and no captures",
        source.display(),
        VIDEO_ENDINGS.join(", ")
    );
    Ok(found)
}

fn is_source(path: &Path) -> bool {
    let is_clip = has_ending(&path.to_string_lossy(), &VIDEO_ENDINGS);
    (is_clip && path.is_file()) || is_capture(path)
}

fn is_capture(path: &Path) -> bool {
    FILES.iter().any(|name| path.join(name).is_file())
}

fn name_of(path: &Path) -> String {
    let stem = match path.is_dir() {
        true => path.file_name(),
        false => path.file_stem(),
    };
    stem.unwrap_or_default().to_string_lossy().into_owned()
}

/// Imports, checks, trains and measures the clip `source`.
fn measured(
    options: &RealOptions,
    source: &Path,
    folder: &Path,
    clip: &mut Clip,
    screen: &dyn Screen,
) -> anyhow::Result<QualityReport> {
    let ffmpeg = options.import.ffmpeg.as_deref();
    let began = Instant::now();
    let capture = match is_capture(source) {
        true => source.to_owned(),
        false => {
            let capture = folder.join("capture");
            to_folder(
                Format::FILM,
                source,
                &capture,
                TrackForm::Json,
                &options.import,
            )?;
            capture
        }
    };
    clip.seconds.import = began.elapsed().as_secs_f64();
    let began = Instant::now();
    let checked = capture_check::check(
        &capture,
        &CaptureOptions::default(),
        ffmpeg,
        &options.import.progress,
    )?;
    clip.seconds.check = began.elapsed().as_secs_f64();
    let measures = &checked.report.measures;
    let named = |grade: Grade| -> Vec<String> {
        let found = measures.iter().filter(|it| it.grade == grade);
        found
            .map(|it| format!("{}: {}", it.kind.title(), it.shown))
            .collect()
    };
    clip.doubts = named(Grade::Warn);
    let failed = named(Grade::Fail);
    ensure!(failed.is_empty(), "the check fails: {}", failed.join("; "));
    let began = Instant::now();
    let film = OneCamera {
        name: clip.name.clone(),
        ..OneCamera::read(&capture, ffmpeg, |_, _| {})?
    };
    clip.frames = film.shard.frames();
    let quality = QualityOptions {
        captures: vec![CaptureSource::OneCamera(capture, film)],
        held_out: HELD_OUT,
        pictures: Some(folder.join("pictures")),
        ..options.quality.clone()
    };
    let report = quality::run(&quality, screen)?;
    clip.seconds.quality = began.elapsed().as_secs_f64();
    Ok(report)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clips_and_captures_are_found_by_name() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = |name: &str| dir.path().join(name);
        for name in ["b.MP4", "a.webm", "notes.txt"] {
            std::fs::write(path(name), "").expect("a file");
        }
        std::fs::create_dir_all(path("c")).expect("a folder");
        std::fs::write(path("c").join(FILES[0]), "").expect("a file");
        std::fs::create_dir_all(path("empty")).expect("a folder");
        let names = |source: &Path| -> Vec<String> {
            let found = sources(source).expect("some");
            found.iter().map(|it| name_of(it)).collect()
        };
        assert_eq!(names(dir.path()), ["a", "b", "c"]);
        assert_eq!(names(&path("c")), ["c"]);
        assert_eq!(names(&path("b.MP4")), ["b"]);
        let error = sources(&path("empty")).expect_err("none");
        assert!(error.to_string().contains("no clips"), "{error}");
    }
}
