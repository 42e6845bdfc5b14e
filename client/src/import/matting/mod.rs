//! Masks that a matting model makes of the frames of a clip.
//!
//! What a network takes and gives is [`yoto_matting`]'s business; here it is found which levels its
//! pictures want ([`levels`]), and it is given the frames in order.

mod levels;

use super::clip::{Clip, fault};
use super::film;
use super::pictures::Mask;
use crate::api::ClientError;
use crate::progress::{ProgressDisplay, count};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;
use yoto_matting::{Form, Levels, Matter, MattingError};

/// A matting model that the user names.
#[derive(Clone, Debug)]
pub struct MattingModel {
    /// Its ONNX file.
    pub path: PathBuf,
    /// The levels that its pictures want, if the user says.
    pub levels: Option<Levels>,
}

/// A frame to make a mask of.
pub(super) struct Wanted {
    /// Its number.
    pub frame: usize,
    /// Where the person is about: a mask of the clip's size, 0 to 255.
    pub expected: Option<Vec<u8>>,
}

impl MattingModel {
    /// Its name, for people.
    pub(super) fn name(&self) -> String {
        let name = self.path.file_name().unwrap_or_default();
        name.to_string_lossy().into_owned()
    }

    /// The person's masks in the frames `wanted`, which rise: frames without anybody have none.
    ///
    /// # Errors
    /// A file that is no matting model; levels that nobody can tell; a network that fails.
    pub(super) fn masks(
        &self,
        clip: &Clip,
        wanted: &[Wanted],
        notes: &mut Vec<String>,
    ) -> Result<BTreeMap<usize, Mask>, ClientError> {
        let mut matter = Matter::open(&self.path, Levels::Unit).map_err(failed)?;
        let levels = match (self.levels, matter.form()) {
            (Some(levels), _) => levels,
            (None, Form::Recurrent) => Levels::Unit,
            (None, Form::Single) => levels::find(self, &mut matter, clip, wanted, notes)?,
        };
        matter.set_levels(levels);
        let frames: Vec<usize> = wanted.iter().map(|it| it.frame).collect();
        let mut display = ProgressDisplay::new("masks");
        let mut masks = BTreeMap::new();
        let mut seconds = 0.0;
        let mut next = wanted.iter();
        film::for_each(clip, &frames, |frame, rgb| {
            display.count("frame", frames.len() - next.len(), frames.len());
            let expected = next.next().and_then(|it| it.expected.as_deref());
            let started = Instant::now();
            let matte = matter.look(rgb, clip.size.map(|side| side as usize), expected);
            seconds += started.elapsed().as_secs_f64();
            let matte = matte.map_err(|error| failed_at(frame, &error))?;
            if matte.is_somebody {
                masks.insert(frame, Mask::Packed(png(&matte.coverage, clip)?));
            }
            Ok(())
        })?;
        display.clear();
        notes.push(format!(
            "masks by {} (levels {}): {}, {:.1} a second",
            self.name(),
            levels.name(),
            count(frames.len(), "frame"),
            frames.len() as f64 / seconds.max(1e-9)
        ));
        if masks.is_empty() {
            let message = format!(
                "finds nobody in {}: are the levels of its pictures others (--matting-levels)?",
                count(frames.len(), "frame")
            );
            return Err(fault(&self.path, "EMPTY", message));
        }
        Ok(masks)
    }
}

/// An error of a matting model, which names its file.
fn failed(error: MattingError) -> ClientError {
    ClientError::Name(error.to_string())
}

/// The same, of a frame.
fn failed_at(frame: usize, error: &MattingError) -> ClientError {
    ClientError::Name(format!("frame {frame} of the clip: {error}"))
}

/// Coverage of a frame as a grey PNG.
pub(super) fn png(coverage: &[u8], clip: &Clip) -> Result<Arc<[u8]>, ClientError> {
    let mut png = Vec::new();
    let [width, height] = clip.size;
    PngEncoder::new_with_quality(&mut png, CompressionType::Fast, FilterType::Up)
        .write_image(coverage, width, height, ExtendedColorType::L8)
        .map_err(|error| fault(clip.path(), "INVALID", error.to_string()))?;
    Ok(png.into())
}
