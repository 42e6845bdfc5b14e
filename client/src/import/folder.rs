//! This project's own capture folder, copied.

use super::pictures::{Mask, MaskKind, PictureFiles, Pictures};
use super::source::Source;
use super::{Imported, Options};
use crate::api::{ClientError, FileSource};
use crate::capture_dir::CaptureDir;
use std::collections::HashMap;
use yoto_proto::media_plan::{self, BackgroundSetting, Planned};

pub(super) fn read(source: &Source, options: &Options) -> Result<Imported, ClientError> {
    let capture = CaptureDir::open(&source.path(""))?;
    let files: HashMap<String, FileSource> = capture
        .files
        .into_iter()
        .map(|file| (file.path, file.source))
        .collect();
    let Planned {
        mut track,
        masks,
        notes,
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
    let kind = match capture.plan.mask_kind {
        media_plan::MaskKind::Coverage => MaskKind::Coverage,
        media_plan::MaskKind::Labels => MaskKind::Labels,
        media_plan::MaskKind::Inverted => {
            let message = "inverted masks are corrected by an upload, not by an import";
            return Err(source.fault("UNSUPPORTED", media_plan::FILE, None, "mask_kind", message));
        }
    };
    let disk = |folder: &str, index: u32| match files.get(&format!("{folder}/{index:06}.png")) {
        Some(FileSource::Disk(path)) => Ok(path.clone()),
        _ => {
            let message =
                "there is no PNG of this frame; videos are read by an upload, not by an import";
            Err(source.fault("MISSING", folder, Some(index), "", message))
        }
    };
    let pictures = track.frames.iter().zip(masks).map(|(frame, mask)| {
        Ok(PictureFiles {
            image: disk("frames", frame.index)?,
            masks: vec![Mask::Image(disk("masks", mask)?, kind)],
            over_black: capture.plan.background != BackgroundSetting::Scene,
        })
    });
    let pictures = Pictures::Files(pictures.collect::<Result<_, ClientError>>()?);
    Ok(Imported {
        track,
        pictures,
        available,
        notes,
    })
}
