//! A matting model given the frames in order.

use super::{MaskRequest, levels, png};
use crate::clip::{Clip, fault, for_each};
use crate::pictures::Mask;
use crate::{ImportError, MattingModel, Progress, Stage};
use std::collections::BTreeMap;
use std::time::Instant;
use yoto_matting::{Levels, Matter, MattingError, ModelForm};
use yoto_proto::text::count;

impl From<crate::Levels> for Levels {
    fn from(levels: crate::Levels) -> Self {
        match levels {
            crate::Levels::Unit => Self::Unit,
            crate::Levels::Signed => Self::Signed,
            crate::Levels::Centred => Self::Centred,
            crate::Levels::ImageNet => Self::ImageNet,
        }
    }
}

/// Implements [`MattingModel::masks`].
pub(super) fn masks(
    model: &MattingModel,
    clip: &Clip,
    wanted: &[MaskRequest],
    progress: &Progress,
    notes: &mut Vec<String>,
) -> Result<BTreeMap<usize, Mask>, ImportError> {
    let mut matter = Matter::open(&model.path, Levels::Unit).map_err(failed)?;
    let levels = match (model.levels, matter.form()) {
        (Some(levels), _) => levels.into(),
        (None, ModelForm::Recurrent) => Levels::Unit,
        (None, ModelForm::Single) => levels::find(model, &mut matter, clip, wanted, notes)?,
    };
    matter.set_levels(levels);
    let frames: Vec<usize> = wanted.iter().map(|it| it.frame).collect();
    let running = progress.start(Stage::Masks);
    let mut masks = BTreeMap::new();
    let mut seconds = 0.0;
    let mut next = wanted.iter();
    for_each(clip, &frames, |frame, rgb| {
        running.count(frames.len() - next.len(), frames.len());
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
    drop(running);
    notes.push(format!(
        "masks by {} (levels {}): {}, {:.2} a second",
        model.name(),
        levels.name(),
        count(frames.len(), "frame"),
        frames.len() as f64 / seconds.max(1e-9)
    ));
    if masks.is_empty() {
        let message = format!(
            "finds nobody in {}: does it expect other levels of its pictures (--matting-levels)?",
            count(frames.len(), "frame")
        );
        return Err(fault(&model.path, "EMPTY", message));
    }
    Ok(masks)
}

/// An error of a matting model, which names its file.
fn failed(error: MattingError) -> ImportError {
    ImportError::Unusable(error.to_string())
}

/// An error of a matting model at a frame of the clip.
pub(super) fn failed_at(frame: usize, error: &MattingError) -> ImportError {
    ImportError::Unusable(format!("frame {frame} of the clip: {error}"))
}
