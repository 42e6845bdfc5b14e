//! Finds the masks of the person: most of the key points lie inside them.

use super::detections::Detection;
use super::misfit;
use super::picture_transform::PictureTransform;
use crate::clip::{Clip, fault};
use crate::pictures::Mask;
use crate::proof::Masks;
use crate::{ImportError, MattingModel, Options};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Least share of points inside the masks of the right person.
const LEAST: f64 = 0.6;

/// The mask of each of the `frames`, of those in `given` that show the person who is `seen` (frame of the clip and
/// points).
///
/// # Errors
/// When the masks can't be read, or the points lie outside.
pub(super) fn find(
    given: &Path,
    clip: &Clip,
    seen: &[(usize, &Detection)],
    frames: &BTreeSet<usize>,
    options: &Options,
    notes: &mut Vec<String>,
) -> Result<BTreeMap<usize, Mask>, ImportError> {
    let all = Masks::given(given, clip)?;
    of_the_person(all, given, clip, seen, frames, options, notes)
}

/// The mask of each of the `frames`, made by a matting model.
///
/// # Errors
/// When the model can't be run, or the points lie outside its masks.
pub(super) fn made(
    model: &MattingModel,
    clip: &Clip,
    seen: &[(usize, &Detection)],
    frames: &BTreeSet<usize>,
    options: &Options,
    notes: &mut Vec<String>,
) -> Result<BTreeMap<usize, Mask>, ImportError> {
    let masks = Masks::made(model, frames.clone(), clip, options, notes)?;
    let all = vec![masks];
    of_the_person(all, &model.path, clip, seen, frames, options, notes)
}

fn of_the_person(
    all: Vec<Masks>,
    given: &Path,
    clip: &Clip,
    seen: &[(usize, &Detection)],
    frames: &BTreeSet<usize>,
    options: &Options,
    notes: &mut Vec<String>,
) -> Result<BTreeMap<usize, Mask>, ImportError> {
    let mut best: Option<(f64, Masks)> = None;
    for masks in all {
        let share = misfit::share(&masks, clip, seen, 0, &PictureTransform::SHOWN)?;
        if best.as_ref().is_none_or(|(most, _)| share > *most) {
            best = Some((share, masks));
        }
    }
    let (share, masks) = best.ok_or_else(|| fault(given, "MISSING", "there are no masks"))?;
    if share < LEAST {
        let mut why = misfit::guess(&masks, clip, seen, &PictureTransform::of(options))?;
        if why.is_none() {
            why = misfit::scaled(&masks, clip, seen)?;
        }
        if why.is_none() {
            why = misfit::shifted(&masks, clip, seen, LEAST)?;
        }
        let why = why.unwrap_or_else(|| "are these of this clip and person?".to_owned());
        let message = format!("most of the key points lie outside the masks: {why}");
        return Err(fault(given, "OUT_OF_RANGE", message));
    }
    notes.push(format!(
        "{}: {:.0} % of the key points lie inside",
        masks.words,
        100.0 * share
    ));
    notes.extend(misfit::shifted(&masks, clip, seen, share)?);
    let of = |frame: &usize| Some((*frame, masks.of_frame(*frame)?));
    Ok(frames.iter().filter_map(of).collect())
}

/// The masks that the detector wrote; `None`, with a note, where it wrote none.
pub(super) fn own(
    seen: &[(usize, &Detection)],
    notes: &mut Vec<String>,
) -> Option<BTreeMap<usize, Mask>> {
    let of = |(frame, detection): &(usize, &Detection)| {
        Some((*frame, Mask::Runs(detection.mask.clone()?)))
    };
    let masks: BTreeMap<usize, Mask> = seen.iter().filter_map(of).collect();
    if masks.is_empty() {
        notes.push("no masks: training needs them (--masks or --matting-model)".to_owned());
        return None;
    }
    notes.push("the masks are the detector's own (--masks for others)".to_owned());
    Some(masks)
}
