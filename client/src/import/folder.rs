//! This project's own capture folder, taken over as it is.

use super::pictures::{Mask, MaskKind, PictureFiles, Pictures};
use super::source::Source;
use super::{Imported, Options};
use crate::api::{ClientError, FileSource};
use crate::capture_dir::CaptureDir;
use std::collections::HashMap;

pub(super) fn read(source: &Source, options: &Options) -> Result<Imported, ClientError> {
    let capture = CaptureDir::open(&source.path(""))?;
    let files: HashMap<String, FileSource> = capture
        .files
        .into_iter()
        .map(|file| (file.path, file.source))
        .collect();
    let mut track = capture.track;
    let positions = options.positions(source, "poses.json", track.frames.len())?;
    let wanted = positions.iter().filter_map(|at| track.frames.get(*at));
    track.frames = wanted.cloned().collect();
    let disk = |folder: &str, index: u32| match files.get(&format!("{folder}/{index:06}.png")) {
        Some(FileSource::Disk(path)) => Ok(path.clone()),
        _ => {
            let message = "there is no image of this frame";
            Err(source.fault("MISSING", folder, Some(index), "", message))
        }
    };
    let pictures = track.frames.iter().map(|frame| {
        Ok(PictureFiles {
            image: disk("frames", frame.index)?,
            masks: vec![Mask::Image(disk("masks", frame.index)?, MaskKind::Coverage)],
            over_black: true,
        })
    });
    let pictures = Pictures::Files(pictures.collect::<Result<_, ClientError>>()?);
    Ok(Imported {
        track,
        pictures,
        notes: Vec::new(),
    })
}
