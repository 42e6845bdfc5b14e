//! The pictures of a clip, one at a time, and their sharpness.

use super::sharpness;
use crate::clip::{Clip, for_each};
use crate::pictures::{Mask, read_image, read_masks};
use crate::{ImportError, Imported, Pictures};
use image::{GrayImage, RgbImage};
use std::collections::BTreeMap;
use std::path::Path;
use yoto_media::source::{Source, SourceError, WantedFrames};
use yoto_media::video::Ffmpeg;
use yoto_media::{Limits, MediaError};
use yoto_proto::media_plan::{self, Timing};
use yoto_proto::pose_track::{PoseTrack, violation};

/// Where a frame's sharpness counts: in its masks, or everywhere if it has none.
fn inside(masks: &[Mask], size: [u32; 2], index: u32) -> Result<GrayImage, ImportError> {
    if masks.is_empty() {
        return Ok(GrayImage::from_pixel(size[0], size[1], image::Luma([255])));
    }
    read_masks(masks, size, index)
}

/// The sharpness of each frame.
pub(super) fn sharpness(
    imported: &Imported,
    ffmpeg: Option<&Path>,
    mut progress: impl FnMut(usize, usize),
) -> Result<Vec<f64>, ImportError> {
    let track = &imported.track;
    let (size, total) = (track.image_size, track.frames.len());
    let indices: Vec<u32> = track.frames.iter().map(|frame| frame.index).collect();
    let mut sharp = Vec::with_capacity(total);
    match &imported.pictures {
        Pictures::Files(files) => {
            for (&index, files) in indices.iter().zip(files) {
                progress(sharp.len(), total);
                let picture = read_image(&files.image, size, index)?;
                sharp.push(sharpness::of(&picture, &inside(&files.masks, size, index)?));
            }
        }
        Pictures::Video { video, masks } => {
            let mut film = Film::open(video, &indices, track, ffmpeg)?;
            for (&index, masks) in indices.iter().zip(masks) {
                progress(sharp.len(), total);
                let picture = film.picture(index, size)?;
                sharp.push(sharpness::of(&picture, &inside(masks, size, index)?));
            }
        }
        Pictures::Decoded { clip, masks } => {
            let wanted: Vec<usize> = indices.iter().map(|index| *index as usize).collect();
            let mut masks = masks.iter();
            for_each(&Clip::again(clip)?, &wanted, |frame, rgb| {
                progress(sharp.len(), total);
                let picture = RgbImage::from_raw(size[0], size[1], rgb.to_vec());
                let masks = masks.next().map(Vec::as_slice).unwrap_or_default();
                let inside = inside(masks, size, frame as u32)?;
                sharp.push(sharpness::of(&picture.unwrap_or_default(), &inside));
                Ok(())
            })?;
        }
        Pictures::Capture(frames) => frames.for_each(|frame| {
            progress(sharp.len(), total);
            let size = [frame.width as u32, frame.height as u32];
            let picture = RgbImage::from_raw(size[0], size[1], frame.rgb).unwrap_or_default();
            let mask = GrayImage::from_raw(size[0], size[1], frame.mask).unwrap_or_default();
            sharp.push(sharpness::of(&picture, &mask));
            Ok(())
        })?,
    }
    progress(total, total);
    Ok(sharp)
}

/// A video, decoded once.
struct Film<'a> {
    path: &'a Path,
    source: Source,
}

impl<'a> Film<'a> {
    /// Opens the video at `path` for the frames `indices`, in ascending order.
    fn open(
        path: &'a Path,
        indices: &[u32],
        track: &PoseTrack,
        ffmpeg: Option<&Path>,
    ) -> Result<Self, ImportError> {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let name = name.into_owned();
        let files = BTreeMap::from([(name.clone(), path.to_owned())]);
        let wanted = WantedFrames {
            indices,
            fps: track.fps,
            timing: Timing::Index,
            size: track.image_size,
        };
        let ffmpeg = Ffmpeg::find(ffmpeg);
        let pictures = media_plan::Pictures::Video(name);
        let source = Source::open(&pictures, &files, wanted, &Limits::default(), &ffmpeg, 20);
        Ok(Self {
            source: source.map_err(|errors| at_fault(path, errors))?,
            path,
        })
    }

    fn picture(&mut self, index: u32, size: [u32; 2]) -> Result<RgbImage, ImportError> {
        let picture = self.source.picture(index);
        let picture = picture.map_err(|error| at_fault(self.path, vec![error]))?;
        let found = [picture.width as u32, picture.height as u32];
        let picture = RgbImage::from_raw(found[0], found[1], picture.rgb);
        picture.filter(|_| found == size).ok_or_else(|| {
            let message = format!(
                "{}x{} pixels, the capture's images have {}x{}",
                found[0], found[1], size[0], size[1]
            );
            let name = self.source.name(index);
            let fault = violation("SIZE_MISMATCH", name, Some(index), "", message);
            at_fault(self.path, vec![SourceError::Bad(fault)])
        })
    }
}

/// The faults of the video at `path`, or the fault of this machine.
fn at_fault(path: &Path, errors: Vec<SourceError>) -> ImportError {
    let mut violations = Vec::with_capacity(errors.len());
    for error in errors {
        match error {
            SourceError::Bad(fault) => violations.push(fault),
            SourceError::Machine(MediaError::Io { path, source }) => {
                return ImportError::file("reading", path)(source);
            }
            SourceError::Machine(MediaError::Bad(fault)) => {
                let name = path.file_name().unwrap_or_default().to_string_lossy();
                violations.push(fault.at(&name, None));
            }
        }
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    ImportError::BadCapture {
        place: folder.display().to_string(),
        violations,
    }
}
