//! This project's own capture folder: PNG pictures are copied, everything else is decoded.

use crate::capture_dir::{CaptureDir, FileSource};
use crate::capture_frames::CaptureFrames;
use crate::pictures::{Mask, MaskKind, PictureFiles, Pictures};
use crate::source::Source;
use crate::{Findings, ImportError, Imported, Options};
use std::collections::HashMap;
use yoto_proto::media_plan::{self, BackgroundSetting, Planned};
use yoto_proto::pose_track::NO_DISTORTION;

pub(crate) fn read(source: &Source, options: &Options) -> Result<Imported, ImportError> {
    let capture = CaptureDir::open(&source.path(""))?;
    let Planned {
        mut track,
        masks,
        mut notes,
    } = capture.planned.ok_or_else(|| {
        source.fault(
            "INVALID",
            "",
            None,
            "",
            "is an archive; unpack it to import it",
        )
    })?;
    let available = track.frames.len();
    let positions = options.positions(source, "poses.json", available)?;
    let all = std::mem::take(&mut track.frames);
    let wanted = positions
        .iter()
        .filter_map(|at| Some((all.get(*at)?.clone(), *masks.get(*at)?)));
    let masks: Vec<u32>;
    (track.frames, masks) = wanted.unzip();
    let files: HashMap<String, FileSource> = capture
        .files
        .into_iter()
        .map(|file| (file.path, file.source))
        .collect();
    let disk = |folder: &str, index: u32| match files.get(&format!("{folder}/{index:06}.png")) {
        Some(FileSource::Disk(path)) => Some(path.clone()),
        _ => None,
    };
    let kind = match capture.plan.mask_kind {
        media_plan::MaskKind::Coverage => Some(MaskKind::Coverage),
        media_plan::MaskKind::Labels => Some(MaskKind::Labels),
        media_plan::MaskKind::Inverted => None,
    };
    let named = track.frames.iter().zip(masks).map(|(frame, mask)| {
        Some(PictureFiles {
            image: disk("frames", frame.index)?,
            masks: vec![Mask::Image(disk("masks", mask)?, kind?)],
            over_black: capture.plan.background != BackgroundSetting::Scene,
        })
    });
    let pictures = match named.collect::<Option<Vec<_>>>() {
        Some(files) => Pictures::Files(files),
        None => {
            let mut frames = CaptureFrames::open(&source.path(""), options.ffmpeg.as_deref())?;
            if track.distortion != NO_DISTORTION {
                notes.push("the lens's distortion is undone in the pictures".to_owned());
            }
            track.distortion = frames.track().distortion;
            frames.positions = positions;
            Pictures::Capture(frames)
        }
    };
    Ok(Imported {
        track,
        pictures,
        available,
        notes,
        found: Findings::default(),
    })
}
